//! Homing inside a drive: CiA 402 methods (IEC 61800-7-201, homing mode), each a seek, a slow return over the edge, an index pulse.
//!
//! The home switch is a cam that reaches to the end of travel: for method 21 it is active on the negative side of its edge, else on the positive one.
//! The edge is latched where it is, not where the bus cycle saw it.

use super::drive::{Index, Switch};

/// Methods that are simulated.
pub const METHODS: [i8; 10] = [1, 2, 17, 18, 21, 23, 33, 34, 35, 37];

/// What a homing method does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Method {
    /// The switch that is sought.
    pub switch: Option<Switch>,
    /// Direction of the seek: -1, 1, or 0 for the place where the axis stands.
    pub direction: f64,
    /// The reference is the first index pulse (behind the switch, if there is one).
    pub index: bool,
}

impl Method {
    /// By its number.
    pub fn of(number: i8) -> Option<Self> {
        let (switch, direction, index) = match number {
            1 => (Some(Switch::Negative), -1.0, true),
            2 => (Some(Switch::Positive), 1.0, true),
            17 => (Some(Switch::Negative), -1.0, false),
            18 => (Some(Switch::Positive), 1.0, false),
            21 => (Some(Switch::Home), -1.0, false),
            23 => (Some(Switch::Home), 1.0, false),
            33 => (None, -1.0, true),
            34 => (None, 1.0, true),
            35 | 37 => (None, 0.0, false),
            _ => return None,
        };
        Some(Self { switch, direction, index })
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Idle,
    /// Fast towards the switch.
    Seek,
    /// Slowly off the switch.
    Leave,
    /// Slowly to the index pulse.
    Index,
    /// The reference is found; the axis brakes.
    Stop,
    Attained,
    Failed,
}

/// What a drive sees in one cycle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sight {
    /// Position before and after the cycle.
    pub from: f64,
    pub to: f64,
    /// Negative limit, positive limit, home.
    pub switches: [bool; 3],
    /// The sought edge is between `from` and `to`: exactly here.
    pub edge: Option<f64>,
    /// The axis is against a mechanical end or cannot follow, in this direction (0: it moves freely).
    pub stalled: f64,
    /// The reference speed is 0.
    pub standing: bool,
}

/// A homing run.
#[derive(Debug, Clone, Copy)]
pub(super) struct Homing {
    method: Method,
    phase: Phase,
    fast: f64,
    slow: f64,
}

impl Homing {
    pub fn new(method: Method, fast: f64, slow: f64) -> Self {
        Self { method, phase: Phase::Idle, fast, slow }
    }
    pub fn method(&self) -> Method {
        self.method
    }
    pub fn running(&self) -> bool {
        matches!(self.phase, Phase::Seek | Phase::Leave | Phase::Index | Phase::Stop)
    }
    pub fn attained(&self) -> bool {
        self.phase == Phase::Attained
    }
    pub fn failed(&self) -> bool {
        self.phase == Phase::Failed
    }
    /// The reference is given up; whether it was attained stays known.
    pub fn abort(&mut self) {
        if self.running() {
            self.phase = Phase::Idle;
        }
    }
    fn active(&self, switches: &[bool; 3]) -> bool {
        self.method.switch.is_some_and(|s| switches[s as usize])
    }
    /// Begins; both limit switches at once cannot be true.
    pub fn start(&mut self, switches: &[bool; 3]) {
        self.phase = match self.method {
            _ if switches[0] && switches[1] => Phase::Failed,
            Method { switch: Some(_), .. } if self.active(switches) => Phase::Leave,
            Method { switch: Some(_), .. } => Phase::Seek,
            Method { index: true, .. } => Phase::Index,
            _ => Phase::Stop,
        };
    }
    /// The reference is at this place at once (methods 35 and 37).
    pub fn in_place(&self) -> bool {
        self.method.direction == 0.0
    }
    /// Speed that the axis shall have now.
    pub fn goal(&self) -> f64 {
        let direction = self.method.direction;
        match self.phase {
            Phase::Seek => direction * self.fast,
            Phase::Leave => -direction * self.slow,
            Phase::Index => self.index_direction() * self.slow,
            _ => 0.0,
        }
    }
    fn index_direction(&self) -> f64 {
        if self.method.switch.is_some() { -self.method.direction } else { self.method.direction }
    }
    /// One cycle; the reference if it has been found in it.
    pub fn advance(&mut self, see: &Sight, index: Option<Index>) -> Option<f64> {
        let direction = match self.phase {
            Phase::Seek => self.method.direction,
            Phase::Leave => -self.method.direction,
            Phase::Index => self.index_direction(),
            Phase::Stop => {
                if see.standing {
                    self.phase = Phase::Attained;
                }
                return None;
            }
            _ => return None,
        };
        let active = self.active(&see.switches);
        match self.phase {
            Phase::Seek if active => self.phase = Phase::Leave,
            Phase::Leave if !active => return self.left(see),
            Phase::Index => {
                if let Some(pulse) = index.and_then(|i| i.crossed(see.from, see.to, direction)) {
                    self.phase = Phase::Stop;
                    return Some(pulse);
                }
            }
            _ => {}
        }
        // Against the end of travel the reference can no longer come. Leaving a limit switch, the same switch is no end.
        let end = see.switches[usize::from(direction > 0.0)]
            && self.method.switch != Some(if direction > 0.0 { Switch::Positive } else { Switch::Negative });
        if see.stalled == direction || self.running() && end {
            self.phase = Phase::Failed;
        }
        None
    }
    fn left(&mut self, see: &Sight) -> Option<f64> {
        if self.method.index {
            self.phase = Phase::Index;
            return None;
        }
        self.phase = Phase::Stop;
        Some(see.edge.unwrap_or(see.to))
    }
}
