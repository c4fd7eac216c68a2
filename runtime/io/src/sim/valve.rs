//! A dispensing valve with opening and closing delay, and the pressure behind it.

use super::OpenError;
use takt_abi::Time;

/// Time constant of the supply, s.
const FILL: f64 = 0.05;
/// Time constant of the decay without air, s.
const LEAK: f64 = 0.5;
/// Part of the pressure that an open valve costs.
const DROP: f64 = 0.02;

/// The valve.
#[derive(Debug, Clone, PartialEq)]
pub struct ValveConfig {
    /// From the command to the open valve.
    pub open_delay: Time,
    /// From the command to the closed valve.
    pub close_delay: Time,
    /// Supply pressure, bar.
    pub pressure: f64,
    /// Digital input that says that there is air; when it goes, the pressure decays. `None`: there always is.
    pub air: Option<String>,
}

impl Default for ValveConfig {
    fn default() -> Self {
        Self { open_delay: Time::from_millis(1), close_delay: Time::from_millis(1), pressure: 4.0, air: None }
    }
}

/// Indices of the valve's terminals.
#[derive(Debug, Clone, Copy)]
pub(super) struct Terminals {
    pub air: Option<usize>,
    pub command: usize,
    pub open: usize,
    pub pressure: usize,
}

/// The valve at run time.
#[derive(Debug, Clone)]
pub(super) struct Valve {
    config: ValveConfig,
    period: Time,
    terminals: Terminals,
    open: bool,
    /// For how long the command has been another than the valve's state.
    differs: Time,
    pressure: f64,
    openings: u64,
}

impl Valve {
    pub fn new(config: &ValveConfig, period: Time, terminals: Terminals) -> Result<Self, OpenError> {
        let rules = [
            ("open-delay", config.open_delay.seconds(), (0..=1_000_000_000).contains(&config.open_delay.0), "0 to 1 s"),
            ("close-delay", config.close_delay.seconds(), (0..=1_000_000_000).contains(&config.close_delay.0), "0 to 1 s"),
            ("pressure", config.pressure, config.pressure >= 0.0 && config.pressure <= 1000.0, "0 to 1000 bar"),
        ];
        match rules.into_iter().find(|r| !r.2) {
            Some((key, value, _, expected)) => Err(OpenError::Range { of: "valve".into(), key, value, expected }),
            None => Ok(Self {
                pressure: config.pressure,
                config: config.clone(),
                period,
                terminals,
                open: false,
                differs: Time(0),
                openings: 0,
            }),
        }
    }

    pub fn advance(&mut self, inputs: &mut [u8], analog: &mut [f64], outputs: &[u8]) {
        let t = self.terminals;
        self.switch(outputs[t.command] != 0);
        let air = t.air.is_none_or(|i| inputs[i] != 0);
        let goal = if air { self.config.pressure * if self.open { 1.0 - DROP } else { 1.0 } } else { 0.0 };
        let constant = if air { FILL } else { LEAK };
        let dt = self.period.seconds();
        self.pressure += (goal - self.pressure) * (dt / constant).min(1.0);
        inputs[t.open] = self.open.into();
        analog[t.pressure] = self.pressure;
    }

    /// A command that is shorter than the delay is lost.
    fn switch(&mut self, command: bool) {
        if command == self.open {
            self.differs = Time(0);
            return;
        }
        self.differs.0 += self.period.0;
        let delay = if command { self.config.open_delay } else { self.config.close_delay };
        if self.differs > delay {
            (self.open, self.differs) = (command, Time(0));
            self.openings += u64::from(command);
        }
    }

    pub fn openings(&self) -> u64 {
        self.openings
    }
}
