//! For tests: an image and an engine's side for blocks, and the smallest axis stage.

use takt_abi::{Cx, Env, Fault, NoHost, OpenArray, Plain, Resources, Time};

/// An image and what stands beside it.
pub struct Bench {
    /// The image.
    pub image: Vec<u8>,
    /// The engine's side; the running task owns the bus, its period is 1 ms.
    pub env: Env,
}

impl Bench {
    /// An image of so many bytes.
    pub fn new(size: usize) -> Self {
        let env = Env {
            now: Time(0),
            period: Time::from_millis(1),
            task: 0,
            cycle: 0,
            bus_task: 0,
            bus_period: Time::from_millis(1),
            resources: Resources::default(),
            host: Box::new(NoHost),
        };
        Self { image: vec![0; size], env }
    }
    /// Calls a body as the instance at `this`.
    pub fn call(&mut self, this: u64, body: impl FnOnce(&mut Cx<'_>) -> Result<(), Fault>) -> Result<(), Fault> {
        let mut fuel = 1_000_000;
        body(&mut Cx::new(&mut self.image, &mut self.env, &mut fuel, this))
    }
    /// Writes a value.
    pub fn put<T: Plain>(&mut self, offset: u64, value: T) {
        value.store(&mut self.image[offset as usize..]);
    }
    /// Reads a value.
    pub fn get<T: Plain>(&self, offset: u64) -> T {
        T::load(&self.image[offset as usize..])
    }
}

/// ARRAY[*] at an offset, with indices from 0.
pub fn open<T: Plain>(offset: u64, len: usize) -> OpenArray<T> {
    let mut raw = [0; 24];
    offset.store(&mut raw);
    (len as i64 - 1).store(&mut raw[16..]);
    OpenArray::load(&raw)
}
