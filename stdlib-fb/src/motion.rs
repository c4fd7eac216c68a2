//! Motion: kinematics, splines, time laws and the blocks on axes.
//!
//! The mathematics stands in modules of pure functions ([`kin5`], [`spline`], [`profile`], [`path_law`]), in radians where angles occur; the blocks around them speak ST:
//! degrees, mm, seconds, PLCopen conventions. The types of `takt-abi` (AXIS_REF_SM3 and its enumerations) are listed in `lib.rs`, not here.

pub mod axis;
#[cfg(test)]
mod bench;
pub mod command;
pub mod follow;
pub mod home;
pub mod jog;
pub mod kin5;
pub mod moves;
#[cfg(test)]
mod oracle;
pub mod path_law;
#[cfg(test)]
mod phone;
pub mod power;
pub mod profile;
pub mod pvt;
pub mod read;
pub mod spline;
pub mod stop;
pub mod transformation;

use takt_abi::{BlockDesc, EnumDesc, FnDesc, StructDesc};

/// The blocks of this topic.
pub const BLOCKS: &[&BlockDesc] = &[
    transformation::ForwardTransformation::DESC,
    transformation::InverseTransformation::DESC,
    pvt::Pvt::DESC,
    follow::FollowPosition::DESC,
    follow::FollowPositionVelocity::DESC,
    power::Power::DESC,
    power::Reset::DESC,
    home::Home::DESC,
    home::SetPosition::DESC,
    stop::Stop::DESC,
    stop::Halt::DESC,
    moves::MoveAbsolute::DESC,
    moves::MoveRelative::DESC,
    moves::MoveVelocity::DESC,
    jog::Jog::DESC,
    read::ReadStatus::DESC,
    read::ReadActualPosition::DESC,
];
/// The functions of this topic.
pub const FUNCTIONS: &[&FnDesc] = &[
    path_law::SCurveTime::DESC,
    path_law::SCurvePos::DESC,
    path_law::SCurveVel::DESC,
    path_law::SCurveAcc::DESC,
    path_law::SCurveTimeAt::DESC,
];
/// The structures of this topic.
pub const STRUCTS: &[&StructDesc] =
    &[transformation::FiveAxisGeometry::DESC, profile::Profile::DESC, command::Command::DESC, follow::Follower::DESC];
/// The enumerations of this topic.
pub const ENUMS: &[&EnumDesc] = &[];
/// Other names of types: (alias, canonical).
pub const ALIASES: &[(&str, &str)] = &[];
