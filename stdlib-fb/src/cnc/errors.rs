//! The texts of SMC_ERROR.

use super::types;
use takt_abi::{SmcError, Str, native_fn};

native_fn! {
    /// What an error number of a motion or CNC block means. The text is English in every language for now; an unknown number gives an empty text.
    pub fn SMC_ErrorString as ErrorString(_cx, ErrorID: SmcError, Language: types::Language) -> Str<101> {
        let _ = Language;
        Ok(Str::new(text(ErrorID)))
    }
}

/// The text of an error, at most 100 bytes; empty for a number that is none.
pub fn text(error: SmcError) -> &'static str {
    TEXTS.iter().find(|(id, _)| *id == error).map_or_else(|| name(error), |(_, text)| text)
}

fn name(error: SmcError) -> &'static str {
    SmcError::DESC.members.iter().find(|(_, value)| *value == i64::from(error.0)).map_or("", |(name, _)| name)
}

const TEXTS: &[(SmcError, &str)] = &[
    (SmcError::SMC_NO_ERROR, "no error"),
    (SmcError::SMC_DI_GENERAL_COMMUNICATION_ERROR, "no communication with the drive: check cable, power and bus"),
    (SmcError::SMC_DI_AXIS_ERROR, "the drive reports an error: read its error number"),
    (SmcError::SMC_DI_FIELDBUS_LOST_SYNCRONICITY, "the bus has lost its synchronism"),
    (SmcError::SMC_DI_SWLIMITS_EXCEEDED, "the axis is or would go beyond its software limits"),
    (SmcError::SMC_DI_HWLIMITS_EXCEEDED, "the axis stands on a limit switch"),
    (SmcError::SMC_DI_LINEAR_AXIS_OUTOFRANGE, "the position does not fit the drive's range"),
    (SmcError::SMC_DI_HALT_OR_QUICKSTOP_NOT_SUPPORTED, "the drive does not know halt or quick stop"),
    (SmcError::SMC_DI_VOLTAGE_DISABLED, "the drive has no power voltage"),
    (SmcError::SMC_DI_IRREGULAR_ACTPOSITION, "the drive reports an impossible position"),
    (SmcError::SMC_DI_POSITIONLAGERROR, "the following error is too large"),
    (SmcError::SMC_DI_HOMING_ERROR, "the drive could not home"),
    (SmcError::SMC_DI_DRIVE_LIMIT_ACTIVE, "a limit of the drive is active"),
    (SmcError::SMC_REGULATOR_OR_START_NOT_SET, "the axis has no power or is in quick stop: switch it on with MC_Power"),
    (SmcError::SMC_WRONG_CONTROLLER_MODE, "the drive is in another controller mode"),
    (SmcError::SMC_INVALID_ACTION_FOR_LOGICAL, "this needs a real drive"),
    (SmcError::SMC_AXIS_IS_NOT_OPERATIONAL, "the axis is not operational: the bus has not started it yet"),
    (SmcError::SMC_FB_WASNT_CALLED_DURING_MOTION, "the block that moves the axis was not called in a cycle"),
    (SmcError::SMC_AXIS_IS_NO_AXIS_REF, "this is no axis"),
    (SmcError::SMC_AXIS_REF_CHANGED_DURING_OPERATION, "the block was given another axis while it worked"),
    (SmcError::SMC_FB_ACTIVE_AXIS_DISABLED, "the axis lost its power while it moved"),
    (SmcError::SMC_AXIS_NOT_READY_FOR_MOTION, "the axis is not ready to move in its present state"),
    (SmcError::SMC_AXIS_ERROR_DURING_MOTION, "the axis is in an error: reset it with MC_Reset"),
    (SmcError::SMC_FB_CALLED_FROM_WRONG_TASK, "blocks on an axis must be called in the task of its bus"),
    (SmcError::SMC_BUFFER_MODE_NOT_SUPPORTED, "this buffer mode is not supported: use Aborting or Buffered"),
    (SmcError::SMC_VD_MAX_VELOCITY_EXCEEDED, "the axis would exceed its greatest velocity"),
    (SmcError::SMC_VD_MAX_ACCELERATION_EXCEEDED, "the axis would exceed its greatest acceleration"),
    (SmcError::SMC_VD_MAX_DECELERATION_EXCEEDED, "the axis would exceed its greatest deceleration"),
    (SmcError::SMC_3SH_INVALID_VELACC_VALUES, "velocity or acceleration is not greater than zero"),
    (SmcError::SMC_R_NO_ERROR_TO_RESET, "the axis has no error to reset"),
    (SmcError::SMC_R_DRIVE_DOESNT_ANSWER, "the drive does not answer to the reset"),
    (SmcError::SMC_R_ERROR_NOT_RESETTABLE, "the drive's error cannot be reset: its cause is still there"),
    (SmcError::SMC_H_AXIS_WASNT_STANDSTILL, "homing needs an axis at standstill"),
    (SmcError::SMC_H_AXIS_DIDNT_START_HOMING, "the drive did not start to home"),
    (SmcError::SMC_H_AXIS_DIDNT_ANSWER, "the drive did not finish homing in time"),
    (SmcError::SMC_H_ERROR_WHEN_STOPPING, "the axis could not stop after homing"),
    (SmcError::SMC_H_AXIS_IN_ERRORSTOP, "homing of an axis in an error: reset it first"),
    (SmcError::SMC_MS_UNKNOWN_STOPPING_ERROR, "the axis could not stop"),
    (SmcError::SMC_MS_INVALID_ACCDEC_VALUES, "deceleration or jerk of the stop is not greater than zero"),
    (SmcError::SMC_MS_DIRECTION_NOT_APPLICABLE, "this direction is not for this axis"),
    (SmcError::SMC_MS_AXIS_IN_ERRORSTOP, "stop of an axis in an error: reset it first"),
    (SmcError::SMC_BLOCKING_MC_STOP_WASNT_CALLED, "another MC_Stop holds the axis"),
    (SmcError::SMC_MA_INVALID_VELACC_VALUES, "velocity, acceleration, deceleration or jerk is not greater than zero"),
    (SmcError::SMC_MA_INVALID_DIRECTION, "this direction is not for this axis"),
    (SmcError::SMC_MV_INVALID_ACCDEC_VALUES, "acceleration, deceleration or jerk is not greater than zero"),
    (SmcError::SMC_MV_DIRECTION_NOT_APPLICABLE, "this direction is not for this axis"),
    (SmcError::SMC_SDL_INVALID_VALUES, "the limits contradict each other"),
    (SmcError::SMC_INVALID_POSITION, "the position is not a finite number"),
    (SmcError::SMC_MP_INVALID_VALUES, "a parameter has an invalid value"),
    (SmcError::SMC_FILE_DOESNT_EXIST, "no such file in the folder nc"),
    (SmcError::SMC_FILE_OUTSIDE_FOLDER, "the path leaves the folder nc"),
    (SmcError::SMC_FILE_NOT_READABLE, "the file cannot be read"),
    (SmcError::SMC_FILE_EMPTY, "the file is empty"),
    (SmcError::SMC_FILE_NOT_TEXT, "the file is not a text file"),
    (SmcError::SMC_FILE_LINE_TOO_LONG, "a line of the file is too long"),
    (SmcError::SMC_FILE_NO_NAME, "no file name was given"),
    (SmcError::SMC_FILE_CHANGED, "the file changed while it was read"),
    (SmcError::SMC_NC_UNKNOWN_WORD, "G-code: unknown word"),
    (SmcError::SMC_NC_WORD_WITHOUT_NUMBER, "G-code: a word without a number"),
    (SmcError::SMC_NC_NUMBER_INVALID, "G-code: not a number, or not a whole one"),
    (SmcError::SMC_NC_NUMBER_OUT_OF_RANGE, "G-code: a number is out of range"),
    (SmcError::SMC_NC_UNKNOWN_G_CODE, "G-code: unknown G code"),
    (SmcError::SMC_NC_WORD_TWICE, "G-code: a word twice in one block"),
    (SmcError::SMC_NC_TWO_TRAVEL_COMMANDS, "G-code: two commands that cannot share a block"),
    (SmcError::SMC_NC_ARC_INVALID, "G-code: an arc that does not close"),
    (SmcError::SMC_NC_FEED_ZERO, "G-code: a move with a velocity of zero"),
    (SmcError::SMC_NC_WORD_MISSING, "G-code: a command lacks a word"),
    (SmcError::SMC_NC_COMMENT_OPEN, "G-code: a comment does not end"),
    (SmcError::SMC_NC_UNEXPECTED_CHARACTER, "G-code: an unexpected character"),
    (SmcError::SMC_NC_WORD_NOT_ALLOWED, "G-code: a word that has no meaning in its block"),
    (SmcError::SMC_DEC_BUFFER_TOO_SMALL, "the buffer of the out queue holds fewer than 5 elements"),
    (SmcError::SMC_DEC_OUTQUEUE_RAN_EMPTY, "the out queue ran empty"),
    (SmcError::SMC_DEC_QUEUE_INVALID, "the sentence queue names no reader"),
    (SmcError::SMC_TRAFO_INVALID_INPUT, "a position, angle or length is not a finite number"),
    (SmcError::SMC_TRAFO_ORIENTATION_UNREACHABLE, "the machine cannot reach this orientation"),
    (SmcError::SMC_TRAFO_POSITION_UNREACHABLE, "the machine cannot reach this position"),
    (SmcError::PVT_TOO_FEW_POINTS, "a spline needs at least two points"),
    (SmcError::PVT_TIMES_NOT_RISING, "the times of the points do not rise"),
    (SmcError::PVT_INVALID_VALUES, "a point is not a finite number"),
    (SmcError::PVT_NO_ROOM, "the spline has no room for these points: see nFree"),
    (SmcError::PVT_NOT_READY, "the spline is not ready"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_error_has_a_text_that_fits() {
        for (member, value) in SmcError::DESC.members {
            let text = text(SmcError(*value as i16));
            assert!(!text.is_empty() && text != *member && text.len() <= 100, "{member}: {text}");
        }
        assert_eq!(text(SmcError(-1)), "");
    }
}
