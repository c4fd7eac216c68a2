//! From words to path elements: what a block of G-code means, given what the blocks before it have set.
//!
//! [`decode`] touches no memory but its arguments: the modal state and a list of at most three elements (an M function, a move, an M function that
//! acts after it). M0, M1 and M60 act after the move of their block, every other M function before it; M2 and M30 end the program and make no element.
//! A move that goes nowhere makes no element.

use super::arc::{Arc, Round, arc};
use super::frame::{Frame, Shift};
use super::trouble::{Kind, Needs, Trouble};
use super::types::{AXIS_WORDS, GeoInfo, MoveType, OriConvention, PosInfo, Vector3};
use super::words::{self, E_DOWN, EF, EF_DOWN, FF, Words, slot};
use takt_abi::{Bool, Plain, Word, st_struct};

st_struct! {
    /// What the blocks of a G-code program have set so far.
    pub struct SMC_NC_MODAL as Modal {
        /// G91: axis words are distances.
        bRelative: Bool,
        /// G98: I, J, K are places.
        bCentreAbsolute: Bool,
        /// Plane of arcs: 17, 18 or 19.
        byPlane: u8 = 17,
        /// A comment of an earlier line is open.
        bComment: Bool,
        /// The travel command in force: 0 to 3; -1: none yet.
        iMotion: i16 = -1,
        /// Number of the last element.
        iObj_No: i32,
        /// Words F, E, E- and FF, EF, EF-, per second.
        dVel: f64, dAccel: f64, dDecel: f64, dVelFF: f64, dAccelFF: f64, dDecelFF: f64,
        /// Where the tool is, in program coordinates.
        piProgram: PosInfo,
        /// Where the tool is, in machine coordinates.
        piMachine: PosInfo,
        /// The coordinate system.
        Frame: Frame
    }
}

/// The elements of a block.
#[derive(Debug)]
pub struct Elements {
    list: [GeoInfo; 3],
    len: usize,
}

impl Default for Elements {
    fn default() -> Self {
        Self { list: [GeoInfo::INIT; 3], len: 0 }
    }
}

impl Elements {
    /// The elements in their order.
    pub fn as_slice(&self) -> &[GeoInfo] {
        &self.list[..self.len]
    }
    /// Forgets them.
    pub fn clear(&mut self) {
        self.len = 0;
    }
    fn push(&mut self, modal: &mut Modal, element: GeoInfo) {
        if let Some(place) = self.list.get_mut(self.len) {
            modal.iObj_No = modal.iObj_No.wrapping_add(1);
            *place = element;
            place.iObj_No = modal.iObj_No;
            self.len += 1;
        }
    }
}

/// Whether the program goes on behind a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flow {
    /// With the next block.
    Next,
    /// Not at all: M2, M30.
    End,
}

/// The command of a block that uses its axis words; at most one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Command {
    None,
    Line { rapid: bool },
    Arc { clockwise: bool },
    Dwell,
    FrameReset,
    FrameSet,
    FrameChange,
    FrameRefer,
    SetPosition,
}

const fn bits(letters: &[u8]) -> u32 {
    let (mut mask, mut i) = (0, 0);
    while i < letters.len() {
        mask |= 1 << slot(letters[i]);
        i += 1;
    }
    mask
}

const AXES: u32 = bits(&AXIS_WORDS);
const CENTRE: u32 = bits(b"IJK");
const ROUND: u32 = bits(b"IJKR");
const ALWAYS: u32 = bits(b"NFEM") | 1 << FF | 1 << E_DOWN | 1 << EF | 1 << EF_DOWN;

/// Decodes one block of line `line` (from 1). The words of the block are `w`.
pub fn decode(w: &Words, modal: &mut Modal, convention: OriConvention, line: u32, out: &mut Elements) -> Result<Flow, Trouble> {
    out.len = 0;
    let mut block = Block { w, modal, convention, line, explicit: None, travel: 0, at: 0 };
    block.run(out).map_err(|t| Trouble { line, ..t })
}

struct Block<'a> {
    w: &'a Words,
    modal: &'a mut Modal,
    convention: OriConvention,
    line: u32,
    /// The travel command that the block itself names.
    explicit: Option<Command>,
    /// G code of the command in tenths, and its column, for messages.
    travel: u32,
    at: u32,
}

impl Block<'_> {
    fn run(&mut self, out: &mut Elements) -> Result<Flow, Trouble> {
        if self.w.is_empty() {
            return Ok(Flow::Next);
        }
        self.g_codes()?;
        self.dynamics()?;
        let command = self.command()?;
        self.check_words(command)?;
        let base = self.base()?;
        let m = self.w.whole(slot(b'M'), 32767.0)?.map(|m| m as i16);
        let late = matches!(m, Some(0 | 1 | 2 | 30 | 60));
        if let Some(m) = m.filter(|_| !late) {
            self.m_function(m, &base, out);
        }
        self.execute(command, base, out)?;
        match m.filter(|_| late) {
            Some(2 | 30) => return Ok(Flow::End),
            Some(m) => self.m_function(m, &self.base()?, out),
            None => {}
        }
        Ok(Flow::Next)
    }

    fn g_codes(&mut self) -> Result<(), Trouble> {
        let mut last = [None; 4];
        for g in self.w.g() {
            let (group, command) = match g.tenths {
                0 => (0, Command::Line { rapid: true }),
                10 => (0, Command::Line { rapid: false }),
                20 => (0, Command::Arc { clockwise: true }),
                30 => (0, Command::Arc { clockwise: false }),
                40 => (0, Command::Dwell),
                530 => (0, Command::FrameReset),
                540 => (0, Command::FrameSet),
                550 => (0, Command::FrameChange),
                560 => (0, Command::FrameRefer),
                920 => (0, Command::SetPosition),
                170 | 180 | 190 => (1, Command::None),
                900 | 910 => (2, Command::None),
                980 | 990 => (3, Command::None),
                _ => return Err(Kind::UnknownG(g.tenths).at(0, g.column)),
            };
            if let Some(before) = last[group].replace(g.tenths) {
                return Err(Kind::TwoCommands(before, g.tenths).at(0, g.column));
            }
            match g.tenths {
                170 | 180 | 190 => self.modal.byPlane = (g.tenths / 10) as u8,
                900 | 910 => self.modal.bRelative = (g.tenths == 910).into(),
                980 | 990 => self.modal.bCentreAbsolute = (g.tenths == 980).into(),
                tenths => {
                    (self.explicit, self.travel, self.at) = (Some(command), tenths, g.column);
                    if tenths <= 30 {
                        self.modal.iMotion = (tenths / 10) as i16;
                    }
                }
            }
        }
        Ok(())
    }

    fn dynamics(&mut self) -> Result<(), Trouble> {
        for f in [slot(b'F'), FF] {
            if self.w.get(f).is_some_and(|v| v < 0.0) {
                return Err(Kind::NotPositive(words::name(f)).at(0, self.w.column(f)));
            }
        }
        let m = &mut *self.modal;
        for (word, place) in [
            (slot(b'F'), &mut m.dVel),
            (slot(b'E'), &mut m.dAccel),
            (E_DOWN, &mut m.dDecel),
            (FF, &mut m.dVelFF),
            (EF, &mut m.dAccelFF),
            (EF_DOWN, &mut m.dDecelFF),
        ] {
            if let Some(value) = self.w.get(word) {
                *place = value.abs();
            }
        }
        Ok(())
    }

    /// The block's command: its own, or the travel command in force when there are words for one.
    fn command(&mut self) -> Result<Command, Trouble> {
        if let Some(command) = self.explicit {
            self.check_explicit(command)?;
            return Ok(command);
        }
        let mask = self.w.mask();
        let arc = matches!(self.modal.iMotion, 2 | 3);
        let centre = arc && mask & ROUND != 0 && mask & bits(b"M") == 0;
        if mask & AXES == 0 && !centre {
            return Ok(Command::None);
        }
        self.at = self.first_column(mask & (AXES | ROUND));
        self.travel = self.modal.iMotion.max(0) as u32 * 10;
        match self.modal.iMotion {
            0 => Ok(Command::Line { rapid: true }),
            1 => Ok(Command::Line { rapid: false }),
            2 | 3 if mask & ROUND == 0 => Err(self.fail(Kind::WordMissing(self.travel, Needs::Centre))),
            2 => Ok(Command::Arc { clockwise: true }),
            3 => Ok(Command::Arc { clockwise: false }),
            _ => Err(self.fail(Kind::NoTravel)),
        }
    }

    /// A command that the block names must have the words it needs. `G1 F20` only sets what holds from now on.
    fn check_explicit(&self, command: Command) -> Result<(), Trouble> {
        let mask = self.w.mask();
        let missing = match command {
            Command::Line { .. } if mask & !bits(b"N") == 0 && self.w.g().len() == 1 => Needs::Axis,
            Command::SetPosition if mask & AXES == 0 => Needs::Axis,
            Command::Arc { .. } if mask & ROUND == 0 => Needs::Centre,
            Command::Dwell if mask & bits(b"T") == 0 => Needs::Time,
            _ => return Ok(()),
        };
        Err(self.fail(Kind::WordMissing(self.travel, missing)))
    }

    fn check_words(&self, command: Command) -> Result<(), Trouble> {
        let mask = self.w.mask();
        let used = match command {
            Command::None | Command::FrameReset => 0,
            Command::Line { .. } | Command::SetPosition | Command::FrameRefer => AXES,
            Command::Arc { .. } => AXES | ROUND,
            Command::Dwell => bits(b"T"),
            Command::FrameSet | Command::FrameChange => AXES | CENTRE,
        };
        let parameter = if mask & bits(b"M") != 0 { bits(b"K") } else { 0 };
        match mask & !(ALWAYS | used | parameter) {
            0 => Ok(()),
            left => {
                let slot = left.trailing_zeros() as u8;
                Err(Kind::NotAllowed(words::name(slot)).at(0, self.w.column(slot)))
            }
        }
    }

    fn execute(&mut self, command: Command, base: GeoInfo, out: &mut Elements) -> Result<(), Trouble> {
        match command {
            Command::None => {}
            Command::Line { rapid } => self.line(rapid, base, out)?,
            Command::Arc { clockwise } => self.arc(clockwise, base, out)?,
            Command::Dwell => {
                let time = self.w.get(slot(b'T')).unwrap_or(0.0);
                if time < 0.0 {
                    return Err(Kind::NotPositive(words::name(slot(b'T'))).at(0, self.w.column(slot(b'T'))));
                }
                let element = GeoInfo { iMoveType: MoveType::DWELL, dT1: time, ..base };
                out.push(self.modal, element);
            }
            Command::SetPosition => {
                let program = self.modal.piProgram.axes();
                let target = std::array::from_fn(|i| self.w.get(slot(AXIS_WORDS[i])).unwrap_or(program[i]));
                self.modal.piProgram = self.modal.piProgram.with_axes(target);
                self.modal.piMachine = self.to_machine(&self.modal.piProgram);
            }
            frame => self.frame(frame)?,
        }
        Ok(())
    }

    fn frame(&mut self, command: Command) -> Result<(), Trouble> {
        let given = |i: usize| self.w.get(slot(AXIS_WORDS[i]));
        let shift = Shift {
            axes: std::array::from_fn(|i| given(i).unwrap_or(0.0)),
            scale: [b'I', b'J', b'K'].map(|l| self.w.get(slot(l)).unwrap_or(1.0)),
        };
        if shift.scale.contains(&0.0) {
            return Err(self.fail(Kind::ScaleZero));
        }
        let modal = &mut *self.modal;
        match command {
            Command::FrameReset => modal.Frame = Frame::default(),
            Command::FrameSet => modal.Frame.set(self.convention, &shift),
            Command::FrameChange => modal.Frame.change(self.convention, &shift),
            _ => {
                let program = modal.piProgram.axes();
                let wanted = modal.piProgram.with_axes(std::array::from_fn(|i| given(i).unwrap_or(program[i])));
                modal.Frame.refer(self.convention, &wanted, &modal.piMachine);
            }
        }
        modal.piProgram = modal.Frame.to_program(self.convention, &modal.piMachine, &modal.piProgram);
        Ok(())
    }

    /// The target of a move in program coordinates, with the axes that have been named so far.
    fn target(&mut self) -> PosInfo {
        let mut values = self.modal.piProgram.axes();
        let mut named = self.modal.piMachine.wAuxData.0;
        for (i, letter) in AXIS_WORDS.iter().enumerate() {
            if let Some(value) = self.w.get(slot(*letter)) {
                values[i] = if self.modal.bRelative.get() { values[i] + value } else { value };
                named |= 1 << i;
            }
        }
        PosInfo { wAuxData: Word(named), ..self.modal.piProgram.with_axes(values) }
    }

    fn to_machine(&self, program: &PosInfo) -> PosInfo {
        self.modal.Frame.to_machine(self.convention, program, &self.modal.piMachine)
    }

    /// Takes the tool to `program` and completes the element.
    fn travel(&mut self, program: PosInfo, machine: PosInfo, element: GeoInfo, out: &mut Elements) {
        (self.modal.piProgram, self.modal.piMachine) = (program, machine);
        if element.dLength > 0.0 {
            out.push(self.modal, GeoInfo { piDestPos: machine, dLengthAct: element.dLength, ..element });
        }
    }

    fn line(&mut self, rapid: bool, base: GeoInfo, out: &mut Elements) -> Result<(), Trouble> {
        if self.w.mask() & AXES == 0 {
            return Ok(());
        }
        let element = GeoInfo { iMoveType: if rapid { MoveType::LINPOS } else { MoveType::LIN }, ..self.with_dynamics(rapid, base)? };
        let program = self.target();
        let machine = self.to_machine(&program);
        let length = distance(&self.modal.piMachine, &machine);
        self.travel(program, machine, GeoInfo { dLength: length, ..element }, out);
        Ok(())
    }

    fn with_dynamics(&self, rapid: bool, base: GeoInfo) -> Result<GeoInfo, Trouble> {
        let m = &self.modal;
        let or = |fast: f64, feed: f64| if rapid && fast != 0.0 { fast } else { feed };
        let velocity = or(m.dVelFF, m.dVel);
        if velocity <= 0.0 {
            return Err(self.fail(if rapid { Kind::RapidZero } else { Kind::FeedZero }));
        }
        Ok(GeoInfo { dVel: velocity, dAccel: or(m.dAccelFF, m.dAccel), dDecel: or(m.dDecelFF, m.dDecel), ..base })
    }

    fn arc(&mut self, clockwise: bool, base: GeoInfo, out: &mut Elements) -> Result<(), Trouble> {
        let base = self.with_dynamics(false, base)?;
        let program = self.target();
        let machine = self.to_machine(&program);
        let in_plane = match self.modal.byPlane {
            18 => [2, 0],
            19 => [1, 2],
            _ => [0, 1],
        };
        let (axes, same_sense) = self.modal.Frame.plane(in_plane).ok_or(self.fail(Kind::ArcScaled))?;
        let round = self.round(in_plane, axes)?;
        let on = |p: [f64; 3]| axes.map(|axis| dot(axis, p));
        let (a, b) = (on(xyz(&self.modal.piMachine)), on(xyz(&machine)));
        let clockwise = clockwise == same_sense;
        let shape: Arc = arc([a[0], a[1]], [b[0], b[1]], round, clockwise).map_err(|kind| self.fail(kind))?;
        let element = GeoInfo {
            iMoveType: if clockwise { MoveType::CLW } else { MoveType::CCLW },
            dP1: shape.centre[0],
            dP2: shape.centre[1],
            dP3: shape.radius,
            dP4: a[2],
            dT1: shape.start,
            dT2: shape.sweep,
            vX: Vector3::new(axes[0]),
            vY: Vector3::new(axes[1]),
            vN: Vector3::new(axes[2]),
            dLength: shape.length(b[2] - a[2]),
            ..base
        };
        self.travel(program, machine, element, out);
        Ok(())
    }

    /// Centre or radius of an arc, in the plane of the machine spanned by `axes`.
    fn round(&self, in_plane: [usize; 2], axes: [[f64; 3]; 3]) -> Result<Round, Trouble> {
        let letters = [b'I', b'J', b'K'];
        let normal = 3 - in_plane[0] - in_plane[1];
        let m = self.w.mask() & bits(b"M") != 0;
        if self.w.get(slot(letters[normal])).is_some() && !(m && letters[normal] == b'K') {
            let word = slot(letters[normal]);
            return Err(Kind::NotAllowed(words::name(word)).at(0, self.w.column(word)));
        }
        let centre = in_plane.map(|axis| self.w.get(slot(letters[axis])));
        let scale = self.modal.Frame.vScale.array()[in_plane[0]].abs();
        match (self.w.get(slot(b'R')), centre) {
            (Some(r), [None, None]) => Ok(Round::Radius(r * scale)),
            (Some(_), _) => Err(Kind::ArcOverdetermined.at(0, self.w.column(slot(b'R')))),
            (None, [None, None]) => Err(self.fail(Kind::WordMissing(self.travel, Needs::Centre))),
            (None, given) => {
                let mut values = self.modal.piProgram.axes();
                for (axis, word) in in_plane.into_iter().zip(given) {
                    values[axis] = match word {
                        Some(word) if self.modal.bCentreAbsolute.get() => word,
                        word => values[axis] + word.unwrap_or(0.0),
                    };
                }
                let p = xyz(&self.to_machine(&self.modal.piProgram.with_axes(values)));
                Ok(Round::Centre([dot(axes[0], p), dot(axes[1], p)]))
            }
        }
    }

    fn m_function(&mut self, m: i16, base: &GeoInfo, out: &mut Elements) {
        let parameter = self.w.get(slot(b'K')).unwrap_or(0.0);
        out.push(self.modal, GeoInfo { iMoveType: MoveType::MCOMMAND, iM_No: m, dP1: parameter, ..*base });
    }

    /// An element that stands where the tool is.
    fn base(&self) -> Result<GeoInfo, Trouble> {
        let sentence = self.w.whole(slot(b'N'), f64::from(i32::MAX))?;
        Ok(GeoInfo {
            iSourceLine_No: self.line.saturating_sub(1).min(i32::MAX as u32) as i32,
            diSentenceNo: sentence.unwrap_or(0.0) as i32,
            piStartPos: self.modal.piMachine,
            piDestPos: self.modal.piMachine,
            ..GeoInfo::INIT
        })
    }

    fn fail(&self, kind: Kind) -> Trouble {
        kind.at(0, self.at)
    }
    fn first_column(&self, mask: u32) -> u32 {
        (0..26).filter(|s| mask & (1 << s) != 0).map(|s| self.w.column(s)).min().unwrap_or(0)
    }
}

fn xyz(p: &PosInfo) -> [f64; 3] {
    [p.dX, p.dY, p.dZ]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The way from `a` to `b`: in X, Y and Z, or when these stand still in the other axes.
fn distance(a: &PosInfo, b: &PosInfo) -> f64 {
    let (a, b) = (a.axes(), b.axes());
    let norm = |range: std::ops::Range<usize>| range.map(|i| (b[i] - a[i]) * (b[i] - a[i])).sum::<f64>().sqrt();
    match norm(0..3) {
        0.0 => norm(3..11),
        way => way,
    }
}

#[cfg(test)]
mod tests;
