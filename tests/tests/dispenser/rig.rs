//! The five-axis dispenser on a bench: a machine of `programs/five-axis-dispenser` with the test as its operator.
//!
//! [`Bench::ready`] gives a machine that is homed; [`Bench::job`] runs a job and records every millisecond of it ([`Row`]). All times are machine time.

use std::fs;
use std::path::{Path, PathBuf};
use takt::machine::{Machine, Setup};
use takt_abi::Time;
use takt_ir::Place;

/// The axes by their names in `GVL`.
pub const AXES: [&str; 5] = ["Theta1", "Theta2", "D1", "D2", "D3"];

/// The members of `MachineState` in their order.
const STATES: [&str; 16] = [
    "Off",
    "PoweringOn",
    "Standby",
    "Homing",
    "Ready",
    "Loading",
    "Loaded",
    "Approaching",
    "Running",
    "Pausing",
    "Paused",
    "Stopping",
    "Done",
    "Jogging",
    "Faulted",
    "EmergencyStop",
];

/// One scan of the 1 ms task.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Tip of the valve in the part frame, mm.
    pub tcp: [f64; 3],
    /// Its speed, mm/s.
    pub speed: f64,
    /// Set positions of the axes, degrees and mm.
    pub axes: [f64; 5],
    /// Dots so far.
    pub dots: u32,
    /// Place on the path, mm.
    pub path: f64,
    /// Seconds to the nearest ramp of the time law; 0 within one.
    pub constant: f64,
    /// Speed over programmed speed.
    pub override_: f64,
    /// The valve is commanded open.
    pub valve: bool,
}

/// Places of what a [`Row`] holds.
struct Places {
    tcp: [Place; 3],
    speed: Place,
    axes: [Place; 5],
    dots: Place,
    path: Place,
    constant: Place,
    override_: Place,
    valve: Place,
    state: Place,
}

/// A machine and its operator.
pub struct Bench {
    /// The machine.
    pub machine: Machine,
    folder: PathBuf,
    places: Places,
}

/// The folder of the program in this repository.
pub fn program() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../programs/five-axis-dispenser")
}

impl Bench {
    /// A machine as it is after power-up, working on a copy of the project, so that a test may put files into `nc/`.
    pub fn new(name: &str) -> Self {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("dispenser-{name}"));
        drop(fs::remove_dir_all(&folder));
        copy(&program(), &folder);
        let project = takt::project::load(&folder).expect("the project can be read");
        let mut machine = Machine::new(&project, Setup::default()).unwrap_or_else(|error| panic!("{error}"));
        machine.dismiss_operator();
        let place = |path: &str| machine.place(path).expect("a name of the contract");
        let places = Places {
            tcp: ["GVL.TcpX", "GVL.TcpY", "GVL.TcpZ"].map(place),
            speed: place("GVL.TcpSpeed"),
            axes: AXES.map(|axis| place(&format!("GVL.{axis}.fSetPosition"))),
            dots: place("GVL.DotCount"),
            path: place("GVL.Follow.PathLength"),
            constant: place("GVL.Follow.Constant"),
            override_: place("GVL.Follow.Override"),
            valve: place("GVL.ValveOpen"),
            state: place("GVL.Sts.State"),
        };
        Self { machine, folder, places }
    }

    /// A machine with power, homed.
    pub fn ready(name: &str) -> Self {
        let mut bench = Self::new(name);
        bench.run(0.1);
        bench.press("ControlOn");
        bench.wait_for("Standby", 5.0);
        bench.press("HomeAll");
        bench.wait_for("Ready", 60.0);
        bench
    }

    /// The project's copy.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Puts a file into `nc/`.
    pub fn file(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.folder.join("nc").join(name), content).expect("the folder is ours");
    }

    /// Sets a variable to an ST literal.
    pub fn set(&mut self, path: &str, value: &str) {
        self.machine.set(path, value).expect("a name of the contract");
    }

    /// A number or BOOL.
    pub fn number(&self, path: &str) -> f64 {
        self.machine.number(path).expect("a name of the contract")
    }

    /// A text.
    pub fn text(&self, path: &str) -> String {
        self.machine.string(path).expect("a name of the contract")
    }

    /// Name of the machine's state.
    pub fn state(&self) -> &'static str {
        STATES.get(self.machine.number_at(self.places.state) as usize).copied().unwrap_or("?")
    }

    /// Lets the machine run.
    pub fn run(&mut self, seconds: f64) {
        let end = self.machine.elapsed().0 + (seconds * 1e9) as i64;
        while self.machine.elapsed().0 < end {
            self.step();
        }
    }

    /// One scan.
    pub fn step(&mut self) {
        self.machine.step();
        if let Some(fault) = self.machine.fault() {
            panic!("{fault:?}");
        }
    }

    /// Presses a button for 20 ms.
    pub fn press(&mut self, command: &str) {
        let path = format!("GVL.Cmd.{command}");
        self.set(&path, "TRUE");
        self.run(0.02);
        self.set(&path, "FALSE");
        self.run(0.005);
    }

    /// Waits for a state.
    pub fn wait_for(&mut self, state: &str, seconds: f64) {
        let end = self.machine.elapsed().0 + (seconds * 1e9) as i64;
        while self.state() != state {
            assert!(
                self.machine.elapsed() < Time(end),
                "waited for {state}, the machine is {}: {}",
                self.state(),
                self.text("GVL.ErrorText")
            );
            self.step();
        }
    }

    /// Loads the job and starts it; returns when it begins to move along the path.
    pub fn start(&mut self) {
        self.press("Load");
        self.wait_for("Loaded", 10.0);
        self.press("Start");
        self.wait_for("Running", 30.0);
    }

    /// What there is to see now.
    pub fn row(&self) -> Row {
        let at = |place: &Place| self.machine.number_at(*place);
        let p = &self.places;
        Row {
            tcp: p.tcp.each_ref().map(at),
            speed: at(&p.speed),
            axes: p.axes.each_ref().map(at),
            dots: at(&p.dots) as u32,
            path: at(&p.path),
            constant: at(&p.constant),
            override_: at(&p.override_),
            valve: at(&p.valve) != 0.0,
        }
    }

    /// Runs on until the job is done, recording every scan.
    pub fn record(&mut self, rows: &mut Vec<Row>) {
        while self.state() != "Done" {
            self.step();
            rows.push(self.row());
            assert!(self.state() != "Faulted" && rows.len() < 400_000, "{}", self.text("GVL.ErrorText"));
        }
    }

    /// A whole job, every scan of it.
    pub fn job(&mut self) -> Vec<Row> {
        self.start();
        let mut rows = vec![self.row()];
        self.record(&mut rows);
        rows
    }
}

/// Where the dots fell.
pub fn dots(rows: &[Row]) -> Vec<[f64; 3]> {
    let mut places = Vec::new();
    let mut before = 0;
    for row in rows {
        assert!(row.dots <= before + 1, "two dots in one scan");
        if row.dots > before {
            places.push(row.tcp);
        }
        before = row.dots;
    }
    places
}

/// Distance of two points.
pub fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    ((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2])).sqrt()
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("the folder is ours");
    for entry in fs::read_dir(from).expect("the program is there") {
        let entry = entry.expect("the program is there");
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), &target).expect("the folder is ours");
        }
    }
}
