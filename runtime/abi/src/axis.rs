//! AXIS_REF_SM3 and its enumerations: what motion blocks and the engine's axis stage share.
//!
//! Once per bus cycle the engine writes actual values and real states (*axis inputs*), the programs run, and the engine reads set values and commands
//! (*axis outputs*): it checks limits, runs the CiA 402 state machine and scales to increments. Blocks never talk to a drive.

use crate::{Bool, Dword, Word, st_enum, st_struct};

st_enum! {
    /// State of an axis (PLCopen Motion Control part 1, state diagram).
    pub enum SMC_AXIS_STATE as AxisState(i16, Int) {
        power_off = 0, errorstop = 1, stopping = 2, standstill = 3, discrete_motion = 4, continuous_motion = 5, synchronized_motion = 6, homing = 7
    }
}
st_enum! {
    /// Direction of a move of a modulo axis.
    pub enum MC_DIRECTION as Direction(i16, Int) { fastest = 3, current = 2, positive = 1, shortest = 0, negative = -1 }
}
st_enum! {
    /// How a motion command follows the one before.
    pub enum MC_BUFFER_MODE as BufferMode(i16, Int) { Aborting = 0, Buffered = 1, BlendingLow = 2, BlendingPrevious = 3, BlendingNext = 4, BlendingHigh = 5 }
}
st_enum! {
    /// What a drive controls.
    pub enum SMC_CONTROLLER_MODE as ControllerMode(i16, Int) { SMC_nocontrol = 0, SMC_torque = 1, SMC_velocity = 2, SMC_position = 3, SMC_current = 4 }
}
st_enum! {
    /// Error numbers of motion and CNC blocks, by their CODESYS names; numbers are stable.
    pub enum SMC_ERROR as SmcError(i16, Int) {
        SMC_NO_ERROR = 0,
        SMC_DI_GENERAL_COMMUNICATION_ERROR = 1, SMC_DI_AXIS_ERROR = 2, SMC_DI_FIELDBUS_LOST_SYNCRONICITY = 3,
        SMC_DI_SWLIMITS_EXCEEDED = 10, SMC_DI_HWLIMITS_EXCEEDED = 11, SMC_DI_LINEAR_AXIS_OUTOFRANGE = 12, SMC_DI_HALT_OR_QUICKSTOP_NOT_SUPPORTED = 13,
        SMC_DI_VOLTAGE_DISABLED = 14, SMC_DI_IRREGULAR_ACTPOSITION = 15, SMC_DI_POSITIONLAGERROR = 16, SMC_DI_HOMING_ERROR = 17, SMC_DI_DRIVE_LIMIT_ACTIVE = 19,
        SMC_REGULATOR_OR_START_NOT_SET = 20, SMC_WRONG_CONTROLLER_MODE = 21, SMC_INVALID_ACTION_FOR_LOGICAL = 25, SMC_AXIS_IS_NOT_OPERATIONAL = 27,
        SMC_FB_WASNT_CALLED_DURING_MOTION = 30, SMC_AXIS_IS_NO_AXIS_REF = 31, SMC_AXIS_REF_CHANGED_DURING_OPERATION = 32, SMC_FB_ACTIVE_AXIS_DISABLED = 33,
        SMC_AXIS_NOT_READY_FOR_MOTION = 34, SMC_AXIS_ERROR_DURING_MOTION = 35, SMC_FB_CALLED_FROM_WRONG_TASK = 36,
        SMC_BUFFER_MODE_NOT_SUPPORTED = 37,
        SMC_VD_MAX_VELOCITY_EXCEEDED = 40, SMC_VD_MAX_ACCELERATION_EXCEEDED = 41, SMC_VD_MAX_DECELERATION_EXCEEDED = 42,
        SMC_3SH_INVALID_VELACC_VALUES = 50,
        SMC_R_NO_ERROR_TO_RESET = 120, SMC_R_DRIVE_DOESNT_ANSWER = 121, SMC_R_ERROR_NOT_RESETTABLE = 122,
        SMC_H_AXIS_WASNT_STANDSTILL = 160, SMC_H_AXIS_DIDNT_START_HOMING = 161, SMC_H_AXIS_DIDNT_ANSWER = 162, SMC_H_ERROR_WHEN_STOPPING = 163, SMC_H_AXIS_IN_ERRORSTOP = 164,
        SMC_MS_UNKNOWN_STOPPING_ERROR = 180, SMC_MS_INVALID_ACCDEC_VALUES = 181, SMC_MS_DIRECTION_NOT_APPLICABLE = 182, SMC_MS_AXIS_IN_ERRORSTOP = 183, SMC_BLOCKING_MC_STOP_WASNT_CALLED = 184,
        SMC_MA_INVALID_VELACC_VALUES = 201, SMC_MA_INVALID_DIRECTION = 202,
        SMC_MV_INVALID_ACCDEC_VALUES = 325, SMC_MV_DIRECTION_NOT_APPLICABLE = 326,
        SMC_SDL_INVALID_VALUES = 360, SMC_INVALID_POSITION = 361,
        SMC_MP_INVALID_VALUES = 400,
        SMC_FILE_DOESNT_EXIST = 1000, SMC_FILE_OUTSIDE_FOLDER = 1001, SMC_FILE_NOT_READABLE = 1002, SMC_FILE_EMPTY = 1003, SMC_FILE_NOT_TEXT = 1004, SMC_FILE_LINE_TOO_LONG = 1005, SMC_FILE_NO_NAME = 1006,
        SMC_FILE_CHANGED = 1007,
        SMC_NC_UNKNOWN_WORD = 1100, SMC_NC_WORD_WITHOUT_NUMBER = 1101, SMC_NC_NUMBER_INVALID = 1102, SMC_NC_NUMBER_OUT_OF_RANGE = 1103, SMC_NC_UNKNOWN_G_CODE = 1104,
        SMC_NC_WORD_TWICE = 1105, SMC_NC_TWO_TRAVEL_COMMANDS = 1106, SMC_NC_ARC_INVALID = 1107, SMC_NC_FEED_ZERO = 1108, SMC_NC_WORD_MISSING = 1109, SMC_NC_COMMENT_OPEN = 1110,
        SMC_NC_UNEXPECTED_CHARACTER = 1111, SMC_NC_WORD_NOT_ALLOWED = 1112,
        SMC_DEC_BUFFER_TOO_SMALL = 1200, SMC_DEC_OUTQUEUE_RAN_EMPTY = 1201, SMC_DEC_QUEUE_INVALID = 1202,
        SMC_TRAFO_INVALID_INPUT = 1300, SMC_TRAFO_ORIENTATION_UNREACHABLE = 1301, SMC_TRAFO_POSITION_UNREACHABLE = 1302,
        PVT_TOO_FEW_POINTS = 1400, PVT_TIMES_NOT_RISING = 1401, PVT_INVALID_VALUES = 1402, PVT_NO_ROOM = 1403, PVT_NOT_READY = 1404
    }
}

st_struct! {
    /// A servo axis: configuration, state, set and actual values in technical units (mm, degrees) per second.
    pub struct AXIS_REF_SM3 as AxisRef {
        /// State of the axis.
        nAxisState: AxisState,
        /// Command: closed-loop control on.
        bRegulatorOn: Bool,
        /// Command: motion allowed (FALSE: quick stop).
        bDriveStart: Bool,
        /// The bus exchanges data with the drive.
        bCommunication: Bool,
        /// 100 = operational.
        wCommunicationState: Word,
        /// Error of the drive (CiA 402 603F), 0 if none.
        uiDriveInterfaceError: u16,
        /// The drive is in control (CiA 402 operation enabled or quick stop active).
        bRegulatorRealState: Bool,
        /// The drive follows set-points (CiA 402 operation enabled).
        bDriveStartRealState: Bool,
        /// Number of the axis, from 0 in the order of the manifest.
        wDriveId: Word,
        /// Incremented when a motion command takes the axis over.
        iOwner: i32,
        /// Period of the bus task, s.
        fTaskCycle: f64,
        /// The axis is in an error.
        bError: Bool,
        /// SMC_ERROR of the axis.
        dwErrorID: Dword,
        /// The error has been acknowledged.
        bErrorAckn: Bool,
        /// The axis knows where it is (absolute encoder, or homed since power-up).
        bHomed: Bool,
        /// Scaling: increments = position * dwRatioTechUnitsDenom / iRatioTechUnitsNum.
        dwRatioTechUnitsDenom: Dword = Dword(1),
        /// Scaling.
        iRatioTechUnitsNum: i32 = 1,
        /// Increments per technical unit.
        fScalefactor: f64 = 1.0,
        /// 0 modulo, 1 finite.
        iMovementType: i16 = 1,
        /// Period of a modulo axis, technical units.
        fPositionPeriod: f64,
        fSetPosition: f64, fSetVelocity: f64, fSetAcceleration: f64, fSetJerk: f64, fSetTorque: f64, fSetCurrent: f64,
        fActPosition: f64, fActVelocity: f64, fActAcceleration: f64, fActTorque: f64, fActCurrent: f64,
        /// Following error, technical units.
        fLagError: f64,
        fSWMaxVelocity: f64 = 1e3, fSWMaxAcceleration: f64 = 1e5, fSWMaxDeceleration: f64 = 1e5, fSWMaxJerk: f64 = 1e7,
        fSWLimitPositive: f64, fSWLimitNegative: f64, bSWLimitEnable: Bool, fSWLimitDeceleration: f64 = 1e5,
        /// Set by a motion block that commands the axis: offset of its instance. 0: nobody.
        nCommandedBy: u64,
        /// Set by the commanding block: `cycle` of the bus task in which it last wrote set values. A moving axis whose block was not called is an error.
        nCommandCycle: u64,
        /// The engine's number of the current bus cycle.
        nBusCycle: u64,
        /// MC_Home's handshake: 0 idle, 1 requested (block), 2 under way (engine), 3 done (engine), 4 failed (engine); the block writes 0 when it has seen 3 or 4.
        byHoming: u8,
        /// MC_Reset's handshake, numbers as `byHoming`.
        byReset: u8,
        /// Home input of MC_Home: the position at the reference, technical units.
        fHomePosition: f64,
        /// Real zero of the axis relative to the drive's: position = drive position - fOffset.
        fOffset: f64
    }
}
