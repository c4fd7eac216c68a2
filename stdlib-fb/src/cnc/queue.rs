//! SMC_OUTQUEUE: the functions that fill, walk and empty a queue of path elements.
//!
//! The queue and its buffer are the program's own memory, so nothing in them is trusted: a queue that contradicts itself is as good as none, a buffer
//! outside the memory is the usual fault of a wild pointer.

use super::types::{GeoInfo, OutQueue};
use takt_abi::{Bool, Cx, Fault, Ptr, Word, native_fn};

/// Bytes of an element.
pub const ELEMENT: u64 = size_of::<GeoInfo>() as u64;
/// Places that a G-code block may need: the interpreter stops when fewer are free.
const BLOCK: u32 = 3;

impl OutQueue {
    /// Whether the fields agree with each other.
    fn is_sound(&self) -> bool {
        self.wOUTQUEUEStructID == Word(0x9878)
            && self.nCapacity > 0
            && self.nReadPos < self.nCapacity
            && self.nWritePos < self.nCapacity
            && self.nCount <= self.nCapacity
    }
    /// Offset of element `i` behind the first.
    fn place(&self, i: u32) -> u64 {
        let at = (u64::from(self.nReadPos) + u64::from(i)) % u64::from(self.nCapacity.max(1));
        self.pbyBuffer.0.saturating_add(at * ELEMENT)
    }
    /// Empties the queue and gives it a buffer of that many elements.
    pub fn start(&mut self, buffer: u64, capacity: u32) {
        *self = Self { pbyBuffer: Ptr::at(buffer), nCapacity: capacity, ..Self::default() };
        self.count();
    }
    /// Brings what follows from position and number up to date.
    fn count(&mut self) {
        self.nWritePos = ((u64::from(self.nReadPos) + u64::from(self.nCount)) % u64::from(self.nCapacity.max(1))) as u32;
        self.bFull = (self.nCapacity - self.nCount.min(self.nCapacity) < BLOCK).into();
    }
    /// Whether a G-code block finds no room.
    pub fn is_full(&self) -> bool {
        !self.is_sound() || self.nCapacity - self.nCount < BLOCK
    }
    /// Appends an element; FALSE when there is no place.
    pub fn append(&mut self, cx: &mut Cx<'_>, element: &GeoInfo) -> Result<bool, Fault> {
        if !self.is_sound() || self.nCount == self.nCapacity {
            return Ok(false);
        }
        cx.store(self.place(self.nCount), element)?;
        self.nCount += 1;
        self.count();
        Ok(true)
    }
    /// Says that nothing will follow, and marks the last element if it is still there.
    pub fn end(&mut self, cx: &mut Cx<'_>) -> Result<(), Fault> {
        self.bEndOfList = Bool::TRUE;
        if self.is_sound() && self.nCount > 0 {
            let place = self.place(self.nCount - 1);
            let mut last: GeoInfo = cx.load(place)?;
            last.bLastBlock = Bool::TRUE;
            cx.store(place, &last)?;
        }
        Ok(())
    }
}

/// The queue behind a pointer, if it is one.
fn open(cx: &Cx<'_>, poq: Ptr<OutQueue>) -> Result<Option<OutQueue>, Fault> {
    if poq.0 == 0 {
        return Ok(None);
    }
    Ok(Some(cx.deref(poq)?).filter(OutQueue::is_sound))
}

fn element(queue: Option<OutQueue>, index: impl Fn(&OutQueue) -> Option<u32>) -> Ptr<GeoInfo> {
    let place = queue.and_then(|q| Some(q.place(index(&q).filter(|i| *i < q.nCount)?)));
    place.map_or(Ptr::NULL, Ptr::at)
}

native_fn! {
    /// Pointer to element `N` of a queue, counted from 0; 0 when there are not so many.
    pub fn SMC_GetObj as GetObj(cx, poq: Ptr<OutQueue>, N: u16) -> Ptr<GeoInfo> {
        Ok(element(open(cx, poq)?, |_| Some(N.into())))
    }
}
native_fn! {
    /// Pointer to element `N` of a queue, counted from its end: 0 is the last. 0 when there are not so many.
    pub fn SMC_GetObjFromEnd as GetObjFromEnd(cx, poq: Ptr<OutQueue>, N: u16) -> Ptr<GeoInfo> {
        Ok(element(open(cx, poq)?, |q| q.nCount.checked_sub(1 + u32::from(N))))
    }
}
native_fn! {
    /// Pointer to the last element of a queue; 0 when it is empty.
    pub fn SMC_GetLastObj as GetLastObj(cx, poq: Ptr<OutQueue>) -> Ptr<GeoInfo> {
        Ok(element(open(cx, poq)?, |q| q.nCount.checked_sub(1)))
    }
}
native_fn! {
    /// Number of elements in a queue (65535 if there are more).
    pub fn SMC_GetCount as GetCount(cx, poq: Ptr<OutQueue>) -> u16 {
        Ok(open(cx, poq)?.map_or(0, |q| q.nCount.min(u16::MAX.into()) as u16))
    }
}
native_fn! {
    /// Takes element `N` (counted from 0) out of a queue; FALSE when there are not so many. With `N` = 0 nothing is moved.
    pub fn SMC_DeleteObj as DeleteObj(cx, poq: Ptr<OutQueue>, N: u16) -> Bool {
        let Some(mut queue) = open(cx, poq)? else { return Ok(Bool::FALSE) };
        let n = u32::from(N);
        if n >= queue.nCount {
            return Ok(Bool::FALSE);
        }
        *cx.fuel -= i64::from(n);
        for i in (0..n).rev() {
            let moved: GeoInfo = cx.load(queue.place(i))?;
            cx.store(queue.place(i + 1), &moved)?;
        }
        queue.nReadPos = (queue.nReadPos + 1) % queue.nCapacity;
        queue.nCount -= 1;
        queue.count();
        cx.store(poq.0, &queue)?;
        Ok(Bool::TRUE)
    }
}
native_fn! {
    /// Appends a copy of `pgi^` to a queue; FALSE when there is no place.
    pub fn SMC_AppendObj as AppendObj(cx, poq: Ptr<OutQueue>, pgi: Ptr<GeoInfo>) -> Bool {
        let Some(mut queue) = open(cx, poq)? else { return Ok(Bool::FALSE) };
        let element = cx.deref(pgi)?;
        let done = queue.append(cx, &element)?;
        cx.store(poq.0, &queue)?;
        Ok(done.into())
    }
}
native_fn! {
    /// Overwrites element `N` (counted from 0) of a queue with `pgi^`; FALSE when there are not so many.
    pub fn SMC_SetObj as SetObj(cx, poq: Ptr<OutQueue>, N: u16, pgi: Ptr<GeoInfo>) -> Bool {
        let place = element(open(cx, poq)?, |_| Some(N.into()));
        if place.0 == 0 {
            return Ok(Bool::FALSE);
        }
        let value = cx.deref(pgi)?;
        cx.store(place.0, &value)?;
        Ok(Bool::TRUE)
    }
}
native_fn! {
    /// Empties a queue and makes it ready for use; buffer and capacity stay. FALSE for a NULL pointer.
    pub fn SMC_OutQueueInit as OutQueueInit(cx, poq: Ptr<OutQueue>) -> Bool {
        if poq.0 == 0 {
            return Ok(Bool::FALSE);
        }
        let mut queue = cx.deref(poq)?;
        queue.start(queue.pbyBuffer.0, queue.nCapacity);
        cx.store(poq.0, &queue)?;
        Ok(Bool::TRUE)
    }
}
native_fn! {
    /// Says how large the buffer of a queue is, in bytes, and empties it. FALSE when not one element fits.
    pub fn SMC_SetQueueCapacity as SetQueueCapacity(cx, poq: Ptr<OutQueue>, nSizeInBytes: u32) -> Bool {
        if poq.0 == 0 {
            return Ok(Bool::FALSE);
        }
        let mut queue = cx.deref(poq)?;
        let capacity = (u64::from(nSizeInBytes) / ELEMENT) as u32;
        queue.start(queue.pbyBuffer.0, capacity);
        cx.store(poq.0, &queue)?;
        Ok((capacity > 0).into())
    }
}
native_fn! {
    /// Whether a queue has no room for a G-code block (three elements), or is none.
    pub fn SMC_OutQueue_IsFull as IsFull(cx, poq: Ptr<OutQueue>) -> Bool {
        Ok(open(cx, poq)?.is_none_or(|q| q.is_full()).into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cnc::reader::tests::env;
    use takt_abi::{NoHost, Plain};

    const QUEUE: u64 = 64;
    const BUFFER: u64 = 1024;
    const ITEM: u64 = 128;

    fn with_queue(capacity: u32, test: impl FnOnce(&mut Cx<'_>)) {
        let (mut env, mut fuel, mut image) = (env(NoHost), 1000, vec![0; 16 * 1024]);
        let mut cx = Cx::new(&mut image, &mut env, &mut fuel, 0);
        cx.store(QUEUE, &OutQueue { pbyBuffer: Ptr::at(BUFFER), ..OutQueue::INIT }).expect("in the image");
        assert!(SetQueueCapacity::call(&mut cx, Ptr::at(QUEUE), capacity * ELEMENT as u32 + 7).expect("runs").get());
        test(&mut cx);
    }

    fn push(cx: &mut Cx<'_>, n: i32) -> bool {
        cx.store(ITEM, &GeoInfo { iObj_No: n, ..GeoInfo::INIT }).expect("in the image");
        AppendObj::call(cx, Ptr::at(QUEUE), Ptr::at(ITEM)).expect("runs").get()
    }

    fn numbers(cx: &mut Cx<'_>) -> Vec<i32> {
        let count = GetCount::call(cx, Ptr::at(QUEUE)).expect("runs");
        (0..count).map(|n| GetObj::call(cx, Ptr::at(QUEUE), n).and_then(|p| cx.deref(p)).expect("an element").iObj_No).collect()
    }

    #[test]
    fn elements_leave_in_the_order_they_came_round_and_round() {
        with_queue(5, |cx| {
            let mut next = 0;
            for round in 0..20 {
                while push(cx, next) {
                    next += 1;
                }
                assert_eq!(numbers(cx), (next - 5..next).collect::<Vec<_>>());
                for _ in 0..=round % 5 {
                    assert!(DeleteObj::call(cx, Ptr::at(QUEUE), 0).expect("runs").get());
                }
            }
        });
    }

    #[test]
    fn an_element_can_be_taken_from_the_middle_and_seen_from_the_end() {
        with_queue(5, |cx| {
            for n in 0..5 {
                push(cx, n);
            }
            assert!(DeleteObj::call(cx, Ptr::at(QUEUE), 2).expect("runs").get());
            assert_eq!(numbers(cx), [0, 1, 3, 4]);
            let last = GetLastObj::call(cx, Ptr::at(QUEUE)).expect("runs");
            let second = GetObjFromEnd::call(cx, Ptr::at(QUEUE), 1).expect("runs");
            assert_eq!((cx.deref(last).expect("last").iObj_No, cx.deref(second).expect("second").iObj_No), (4, 3));
            assert_eq!(GetObjFromEnd::call(cx, Ptr::at(QUEUE), 4).expect("runs").0, 0);
            assert_eq!(GetObj::call(cx, Ptr::at(QUEUE), 4).expect("runs").0, 0);
            assert!(!DeleteObj::call(cx, Ptr::at(QUEUE), 4).expect("runs").get());
            assert!(IsFull::call(cx, Ptr::at(QUEUE)).expect("runs").get());
            assert!(OutQueueInit::call(cx, Ptr::at(QUEUE)).expect("runs").get());
            assert_eq!(numbers(cx), [0i32; 0]);
        });
    }

    #[test]
    fn a_queue_that_contradicts_itself_is_none_and_a_wild_one_is_a_fault() {
        with_queue(5, |cx| {
            push(cx, 1);
            let sound: OutQueue = cx.load(QUEUE).expect("in the image");
            for broken in [
                OutQueue { nCount: 6, ..sound },
                OutQueue { nReadPos: 5, ..sound },
                OutQueue { nCapacity: 0, ..sound },
                OutQueue { wOUTQUEUEStructID: Word(1), ..sound },
            ] {
                cx.store(QUEUE, &broken).expect("in the image");
                assert_eq!(GetObj::call(cx, Ptr::at(QUEUE), 0).expect("runs").0, 0);
                assert_eq!(GetCount::call(cx, Ptr::at(QUEUE)).expect("runs"), 0);
                assert!(!push(cx, 2));
            }
            cx.store(QUEUE, &OutQueue { pbyBuffer: Ptr::at(u64::MAX - 5), ..sound }).expect("in the image");
            assert!(matches!(AppendObj::call(cx, Ptr::at(QUEUE), Ptr::at(ITEM)), Err(Fault::WildPointer { .. })));
            assert!(matches!(GetCount::call(cx, Ptr::at(1 << 40)), Err(Fault::WildPointer { .. })));
            assert_eq!(GetCount::call(cx, Ptr::NULL), Ok(0));
        });
    }
}
