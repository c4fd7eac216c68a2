//! The types of the CNC library, by their CODESYS names.
//!
//! Positions are mm (X, Y, Z and linear additional axes) and degrees (A, B, C), velocities and accelerations per second. The layout is that of the
//! image, so ST walks a queue with pointers.

use takt_abi::{Bool, Handle, Lword, Ptr, Word, st_enum, st_struct};

st_enum! {
    /// What a path element is.
    pub enum SMC_MOVTYP as MoveType(i16, Int) {
        /// Straight line with feed (G1).
        LIN = 1,
        /// Arc or helix, clockwise (G2).
        CLW = 2,
        /// Arc or helix, counter-clockwise (G3).
        CCLW = 3,
        /// Spline or parabola.
        SPLINE = 5,
        /// Ellipse, clockwise.
        ELLCLW = 8,
        /// Ellipse, counter-clockwise.
        ELLCCLW = 9,
        /// Straight line, rapid (G0).
        LINPOS = 100,
        /// Start position.
        INITPOS = 110,
        /// M function: `iM_No`; no way.
        MCOMMAND = 120,
        /// Dwell (G4): `dT1` seconds; no way.
        DWELL = 121
    }
}
st_enum! {
    /// What the interpreter takes the words A, B and C for when the coordinate system is turned.
    pub enum SMC_ORI_CONVENTION as OriConvention(i16, Int) {
        /// Additional axes: G54, G55 and G56 only shift them.
        ADDAXES = 0,
        /// Angles about Z, Y', Z''.
        ZYZ = 1,
        /// Angles about Z, Y', X'': yaw, pitch, roll.
        ZYX = 2,
        /// Angles about X, Y', Z''.
        XYZ = 3
    }
}
st_enum! {
    /// What the interpreter is doing.
    pub enum SMC_DEC_STATUS as DecoderStatus(i16, Int) {
        /// No program, or waiting for the file.
        WAIT_PROG = 0,
        /// Decoding.
        READ_WORD = 1,
        /// The program is decoded.
        PROG_READ = 2
    }
}
st_enum! {
    /// Language of `SMC_ErrorString`.
    pub enum SMC_LANGUAGE_TYPE as Language(i16, Int) { english = 0, german = 1 }
}

st_struct! {
    /// A vector, mm (or without unit where it is a direction).
    pub struct SMC_VECTOR3D as Vector3 { dX: f64, dY: f64, dZ: f64 }
}

st_struct! {
    /// A position of all axes of a path: mm and degrees.
    pub struct SMC_POSINFO as PosInfo {
        /// Number of the frame; 0.
        iFrameNo: i16,
        /// The axes that the program has named: bit 0 X, 1 Y, 2 Z, 3 A, 4 B, 5 C, 6 P, 7 Q, 8 U, 9 V, 10 W.
        wAuxData: Word,
        /// Axes with an S profile; 0.
        wSProfile: Word,
        /// X, mm.
        dX: f64,
        /// Y, mm.
        dY: f64,
        /// Z, mm.
        dZ: f64,
        /// A, degrees.
        dA: f64,
        /// B, degrees.
        dB: f64,
        /// C, degrees.
        dC: f64,
        /// Word P.
        dA1: f64,
        /// Word Q.
        dA2: f64,
        /// Word U.
        dA3: f64,
        /// Word V.
        dA4: f64,
        /// Word W.
        dA5: f64,
        /// No word.
        dA6: f64
    }
}

st_struct! {
    /// A path element: a straight line, an arc, a dwell or an M function.
    ///
    /// Straight line: from `piStartPos` to `piDestPos`. Arc: `dP1`, `dP2` the centre along `vX` and `vY`, `dP3` the radius, `dP4` the height along `vN`
    /// at the start, `dT1` the angle of the start in degrees (from `vX` towards `vY`), `dT2` the sweep in degrees, + clockwise; the height grows evenly
    /// to that of `piDestPos`.
    pub struct SMC_GEOINFO as GeoInfo {
        /// Number of the element, from 1.
        iObj_No: i32,
        /// Line of the file, from 0.
        iSourceLine_No: i32,
        /// The N word of the block, 0 without one.
        diSentenceNo: i32,
        /// What it is.
        iMoveType: MoveType,
        /// Number of the M function (MCOMMAND).
        iM_No: i16,
        /// Where it starts.
        piStartPos: PosInfo,
        /// Where it ends.
        piDestPos: PosInfo,
        /// Arc: centre along vX, mm. M function: its K word.
        dP1: f64,
        /// Arc: centre along vY, mm.
        dP2: f64,
        /// Arc: radius, mm.
        dP3: f64,
        /// Arc: height along vN at the start, mm.
        dP4: f64,
        dP5: f64, dP6: f64, dP7: f64, dP8: f64, dP9: f64, dP10: f64, dP11: f64, dP12: f64,
        dP13: f64, dP14: f64, dP15: f64, dP16: f64, dP17: f64, dP18: f64,
        /// First axis of the plane of an arc.
        vX: Vector3,
        /// Second axis of the plane.
        vY: Vector3,
        /// Normal of the plane.
        vN: Vector3,
        /// Arc: start angle, degrees. Dwell: time, s.
        dT1: f64,
        /// Arc: sweep, degrees, + clockwise.
        dT2: f64,
        /// Set velocity along the path, per second.
        dVel: f64,
        /// Velocity at the end, per second: 0 until velocities are checked.
        dVel_End: f64,
        /// Acceleration along the path, per s²; 0: the planner's own.
        dAccel: f64,
        /// Deceleration along the path, per s²; 0: the planner's own.
        dDecel: f64,
        /// Length of the way: mm in X, Y, Z; where these stand still, of the other axes (degrees).
        dLength: f64,
        /// Length that is left of it when it has been cut; `dLength` otherwise.
        dLengthAct: f64,
        /// The last element of the program (known only if it was still in the queue when the end was read).
        bLastBlock: Bool
    }
}

st_struct! {
    /// A queue of path elements: a ring in a buffer that the ST program owns. Use the functions SMC_GetObj, SMC_GetCount, SMC_DeleteObj, ….
    pub struct SMC_OUTQUEUE as OutQueue {
        /// Says that this is a queue.
        wOUTQUEUEStructID: Word = Word(0x9878),
        /// The buffer.
        pbyBuffer: Ptr<[GeoInfo; 1]>,
        /// Elements that the buffer holds.
        nCapacity: u32,
        /// Place of the first element.
        nReadPos: u32,
        /// Place behind the last element.
        nWritePos: u32,
        /// Elements in the queue.
        nCount: u32,
        /// Nothing will be appended any more.
        bEndOfList: Bool,
        /// Fewer than three places are free (a G-code block may need three), so the interpreter waits.
        bFull: Bool
    }
}

st_struct! {
    /// The sentences that a reader hands to an interpreter. Opaque: the text lies with the reader.
    pub struct SMC_GSentenceQueue as SentenceQueue {
        /// The reader's buffer.
        hReader: Handle
    }
}

st_struct! {
    /// Variables that a G-code program may name. Opaque; expressions are not read yet.
    pub struct SMC_VARLIST as VarList {
        /// Number of variables.
        wNumberVars: Word,
        /// The variables.
        psvVarList: Lword
    }
}

/// The axis words in the order of [`PosInfo::axes`].
pub const AXIS_WORDS: [u8; 11] = *b"XYZABCPQUVW";

impl PosInfo {
    /// The values in the order of [`AXIS_WORDS`].
    pub fn axes(&self) -> [f64; 11] {
        [self.dX, self.dY, self.dZ, self.dA, self.dB, self.dC, self.dA1, self.dA2, self.dA3, self.dA4, self.dA5]
    }
    /// A position of those values; the rest is taken from `self`.
    pub fn with_axes(mut self, v: [f64; 11]) -> Self {
        [self.dX, self.dY, self.dZ, self.dA, self.dB, self.dC, self.dA1, self.dA2, self.dA3, self.dA4, self.dA5] = v;
        self
    }
}

impl Vector3 {
    /// The vector of those components.
    pub const fn new([x, y, z]: [f64; 3]) -> Self {
        Self { dX: x, dY: y, dZ: z }
    }
    /// The components.
    pub fn array(&self) -> [f64; 3] {
        [self.dX, self.dY, self.dZ]
    }
}
