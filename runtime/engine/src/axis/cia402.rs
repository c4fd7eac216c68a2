//! The drive's state machine as CiA 402 (IEC 61800-7-201) tells it: states from the statusword, controlwords that lead to a goal.

/// State of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DriveState {
    /// Self-test.
    NotReady,
    /// Powered, output stage locked.
    SwitchOnDisabled,
    /// May be switched on.
    ReadyToSwitchOn,
    /// Switched on, output stage off.
    SwitchedOn,
    /// Follows set-points.
    OperationEnabled,
    /// Brakes or has braked on its own ramp.
    QuickStopActive,
    /// Brakes because of a fault.
    FaultReaction,
    /// In a fault.
    Fault,
}

impl DriveState {
    /// All of them.
    pub(crate) const ALL: [Self; 8] = [
        Self::NotReady,
        Self::SwitchOnDisabled,
        Self::ReadyToSwitchOn,
        Self::SwitchedOn,
        Self::OperationEnabled,
        Self::QuickStopActive,
        Self::FaultReaction,
        Self::Fault,
    ];
    /// From the statusword.
    pub fn of(status: u16) -> Self {
        match (status & 0x4F, status & 0x6F) {
            (0x0F, _) => Self::FaultReaction,
            (0x08, _) => Self::Fault,
            (0x40, _) => Self::SwitchOnDisabled,
            (_, 0x21) => Self::ReadyToSwitchOn,
            (_, 0x23) => Self::SwitchedOn,
            (_, 0x27) => Self::OperationEnabled,
            (_, 0x07) => Self::QuickStopActive,
            _ => Self::NotReady,
        }
    }
    /// The output stage is on.
    pub fn in_control(self) -> bool {
        matches!(self, Self::OperationEnabled | Self::QuickStopActive)
    }
    /// A fault, also while it still brakes.
    pub fn is_fault(self) -> bool {
        matches!(self, Self::Fault | Self::FaultReaction)
    }
}

/// Where the drive is to be led.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Goal {
    /// Output stage off.
    Off,
    /// In control, at rest by its own quick-stop ramp.
    QuickStop,
    /// Following set-points.
    Enabled,
}

/// Bit 4: start of homing (mode 6).
pub const HOMING_START: u16 = 1 << 4;
/// Bit 7: a rising edge resets a fault.
pub const FAULT_RESET: u16 = 1 << 7;
/// Status bit 10: target reached.
pub const TARGET_REACHED: u16 = 1 << 10;
/// Status bit 12: homing attained (mode 6).
pub const HOMING_ATTAINED: u16 = 1 << 12;
/// Status bit 13: homing error (mode 6).
pub const HOMING_ERROR: u16 = 1 << 13;
/// Cyclic synchronous position.
pub const MODE_POSITION: i8 = 8;
/// Homing.
pub const MODE_HOMING: i8 = 6;

const SHUTDOWN: u16 = 0x06;
const SWITCH_ON: u16 = 0x07;
const ENABLE: u16 = 0x0F;
const QUICK_STOP: u16 = 0x0B;
const DISABLE_VOLTAGE: u16 = 0x00;

/// The controlword that leads from a state one step towards the goal.
pub fn control(state: DriveState, goal: Goal) -> u16 {
    use DriveState as S;
    match (state, goal) {
        (S::NotReady | S::Fault | S::FaultReaction, _) => DISABLE_VOLTAGE,
        (S::OperationEnabled, Goal::Off) => SHUTDOWN,
        (_, Goal::Off) => DISABLE_VOLTAGE,
        (S::SwitchOnDisabled, _) => SHUTDOWN,
        (S::ReadyToSwitchOn, _) => SWITCH_ON,
        (S::SwitchedOn, Goal::QuickStop) => SWITCH_ON,
        (S::OperationEnabled | S::QuickStopActive, Goal::QuickStop) => QUICK_STOP,
        (_, Goal::Enabled) => ENABLE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_statusword_names_eight_states() {
        for (status, expected) in [
            (0x0000, DriveState::NotReady),
            (0x0250, DriveState::SwitchOnDisabled),
            (0x0231, DriveState::ReadyToSwitchOn),
            (0x0233, DriveState::SwitchedOn),
            (0x1637, DriveState::OperationEnabled),
            (0x0217, DriveState::QuickStopActive),
            (0x021F, DriveState::FaultReaction),
            (0x0218, DriveState::Fault),
        ] {
            assert_eq!(DriveState::of(status), expected, "{status:#06x}");
        }
    }

    #[test]
    fn each_goal_is_reached_step_by_step() {
        use DriveState as S;
        assert_eq!(control(S::SwitchOnDisabled, Goal::Enabled), 0x06);
        assert_eq!(control(S::ReadyToSwitchOn, Goal::Enabled), 0x07);
        assert_eq!(control(S::SwitchedOn, Goal::Enabled), 0x0F);
        assert_eq!(control(S::QuickStopActive, Goal::Enabled), 0x0F);
        assert_eq!(control(S::OperationEnabled, Goal::QuickStop) & 0x86, 0x02, "quick stop: bit 2 off, bit 1 on");
        assert_eq!(control(S::OperationEnabled, Goal::Off), 0x06);
        assert_eq!(control(S::QuickStopActive, Goal::Off), 0x00);
        assert_eq!(control(S::Fault, Goal::Enabled), 0x00, "nobody resets a fault unasked");
    }
}
