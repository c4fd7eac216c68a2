//! Blocks and what they mean.

use super::*;
use crate::cnc::words::Comments;

fn program(text: &str) -> Result<(Vec<GeoInfo>, Modal), Trouble> {
    program_in(OriConvention::ADDAXES, text)
}

fn program_in(convention: OriConvention, text: &str) -> Result<(Vec<GeoInfo>, Modal), Trouble> {
    let (mut modal, mut out, mut all) = (Modal { dVel: 10.0, dAccel: 100.0, ..Modal::INIT }, Elements::default(), Vec::new());
    let (mut words, mut comments) = (Words::default(), Comments { parentheses: true, open: false });
    for (i, line) in text.lines().enumerate() {
        words.read(line.as_bytes(), &mut comments)?;
        let flow = decode(&words, &mut modal, convention, i as u32 + 1, &mut out)?;
        all.extend_from_slice(out.as_slice());
        if flow == Flow::End {
            break;
        }
    }
    Ok((all, modal))
}

fn good(text: &str) -> Vec<GeoInfo> {
    program(text).unwrap_or_else(|e| panic!("{text}: {e:?}")).0
}

fn refused(text: &str, kind: Kind, line: u32, column: u32) {
    let error = program(text).map(|_| ()).expect_err(text);
    assert_eq!(error, kind.at(line, column), "{text}");
}

#[test]
fn a_line_goes_on_where_the_last_one_ended() {
    let e = good("G90\nN20 G1 X3 Y4 F20\nX3 Y4 Z2\nG91 X1 C5\nG90 C10");
    assert_eq!(e.len(), 4);
    assert_eq!((e[0].iObj_No, e[0].iSourceLine_No, e[0].diSentenceNo, e[0].iMoveType), (1, 1, 20, MoveType::LIN));
    assert_eq!((e[0].dLength, e[0].dVel, e[0].dAccel), (5.0, 20.0, 100.0));
    assert_eq!((e[1].piStartPos.dX, e[1].piDestPos.dZ, e[1].dLength), (3.0, 2.0, 2.0));
    assert_eq!((e[2].piDestPos.dX, e[2].piDestPos.dC, e[2].dLength), (4.0, 5.0, 1.0));
    assert_eq!((e[3].dLength, e[3].iMoveType, e[3].piDestPos.wAuxData), (5.0, MoveType::LIN, Word(0b100111)), "a rotary way");
}

#[test]
fn a_rapid_takes_its_own_velocity_where_there_is_one() {
    let e = good("G0 X10\nFF500 EF9 EF-8 X20\nG1 X30 E7 E-6\nFF0 G0 X0");
    assert_eq!((e[0].iMoveType, e[0].dVel), (MoveType::LINPOS, 10.0));
    assert_eq!((e[1].dVel, e[1].dAccel, e[1].dDecel), (500.0, 9.0, 8.0));
    assert_eq!((e[2].dVel, e[2].dAccel, e[2].dDecel), (10.0, 7.0, 6.0));
    assert_eq!(e[3].dVel, 10.0);
}

#[test]
fn arcs_have_centre_radius_and_sweep() {
    let e = good("G1 X10\nG3 X0 Y10 I-10\nG2 X10 Y0 R10\nG2 I-10 Z3");
    let shape = |g: &GeoInfo| (g.iMoveType, [g.dP1, g.dP2, g.dP3].map(|v| v.round()), g.dT1.round(), g.dT2.round());
    assert_eq!(shape(&e[1]), (MoveType::CCLW, [0.0, 0.0, 10.0], 0.0, -90.0));
    assert_eq!(shape(&e[2]), (MoveType::CLW, [0.0, 0.0, 10.0], 90.0, 90.0));
    assert_eq!(shape(&e[3]), (MoveType::CLW, [0.0, 0.0, 10.0], 0.0, 360.0));
    assert!((e[3].dLength - libm::hypot(20.0 * std::f64::consts::PI, 3.0)).abs() < 1e-9, "a helix");
    let absolute = good("G1 X10 Y5\nG98 G3 X5 Y10 I5 J5");
    assert_eq!(shape(&absolute[1]), (MoveType::CCLW, [5.0, 5.0, 5.0], 0.0, -90.0));
    let zx = good("G1 Z10\nG18 G3 X10 Z0 K-10 Y4");
    assert_eq!(shape(&zx[1]), (MoveType::CCLW, [0.0, 0.0, 10.0], 0.0, -90.0));
    assert_eq!((zx[1].vX.dZ, zx[1].vY.dX, zx[1].vN.dY, zx[1].piDestPos.dY), (1.0, 1.0, 1.0, 4.0));
    let yz = good("G1 Y10\nG19 G2 Y0 Z-10 J-10");
    assert_eq!(shape(&yz[1]), (MoveType::CLW, [0.0, 0.0, 10.0], 0.0, 90.0));
}

#[test]
fn m_functions_stand_at_their_place_and_m30_ends() {
    let e = good("G1 X1 M8 K3\nM09\nX2 M0\nG4 T1.5\nX3 M30\nX4");
    let kinds: Vec<_> = e.iter().map(|g| (g.iMoveType.0, g.iM_No, g.piStartPos.dX)).collect();
    assert_eq!(kinds, [(120, 8, 0.0), (1, 0, 0.0), (120, 9, 1.0), (1, 0, 1.0), (120, 0, 2.0), (121, 0, 2.0), (1, 0, 2.0)]);
    assert_eq!((e[0].dP1, e[5].dT1), (3.0, 1.5));
}

#[test]
fn the_coordinate_system_is_shifted_turned_and_scaled() {
    let e = good("G1 X1\nG54 X10\nX1\nG55 Y5\nX1\nG56 X0 Y0\nX1\nG53\nX1");
    let ends: Vec<_> = e.iter().map(|g| (g.piDestPos.dX, g.piDestPos.dY)).collect();
    assert_eq!(ends, [(1.0, 0.0), (11.0, 0.0), (12.0, 0.0), (1.0, 0.0)], "a shift alone makes no way");
    let (e, _) = program_in(OriConvention::ZYX, "G54 A90 I2 J2\nG1 X10 A0\nG3 X0 Y10 I-10").expect("turned");
    assert!((e[0].piDestPos.dY - 20.0).abs() < 1e-12 && (e[0].piDestPos.dA - 90.0).abs() < 1e-9);
    assert!((e[1].piDestPos.dX + 20.0).abs() < 1e-9 && (e[1].dP3 - 20.0).abs() < 1e-9 && (e[1].dT2 + 90.0).abs() < 1e-9, "{}", e[1].dT2);
    let (e, _) = program("G54 I-1\nG1 X10\nG3 X0 Y10 I-10").expect("mirrored");
    assert_eq!((e[1].iMoveType, e[1].piDestPos.dX, e[1].dT2.round()), (MoveType::CLW, 0.0, 90.0), "a mirror turns the sense");
    refused("G54 I2\nG1 X10\nG3 X0 Y10 I-10", Kind::ArcScaled, 3, 1);
    refused("G54 I0", Kind::ScaleZero, 1, 1);
}

#[test]
fn g92_says_where_the_tool_is() {
    let e = good("G92 X10 Y10\nG1 X20");
    assert_eq!((e.len(), e[0].piStartPos.dX, e[0].piDestPos.dX, e[0].piDestPos.dY), (1, 10.0, 20.0, 10.0));
}

#[test]
fn bad_blocks_are_refused_with_line_and_column() {
    refused("G1 X1\nN2 G01", Kind::WordMissing(10, Needs::Axis), 2, 4);
    refused("X1", Kind::NoTravel, 1, 1);
    refused("G68.2 X1", Kind::UnknownG(682), 1, 1);
    refused("G90 G20", Kind::UnknownG(200), 1, 5);
    refused("G1 G0 X1", Kind::TwoCommands(10, 0), 1, 4);
    refused("G90 G91", Kind::TwoCommands(900, 910), 1, 5);
    refused("G1 X1 F0", Kind::FeedZero, 1, 1);
    refused("F0\nG0 X1", Kind::RapidZero, 2, 1);
    refused("G1 X1 F-5", Kind::NotPositive(words::name(slot(b'F'))), 1, 7);
    refused("G2 X1", Kind::WordMissing(20, Needs::Centre), 1, 1);
    refused("G2 I5 X1\nX3", Kind::ArcOpen(5.0, 4.0), 1, 1);
    refused("G2 X10 R5\nX30", Kind::WordMissing(20, Needs::Centre), 2, 1);
    refused("G2 X10 R4", Kind::ArcRadius(4.0, 5.0), 1, 1);
    refused("G2 X10 R5 I5", Kind::ArcOverdetermined, 1, 8);
    refused("G2 X10 I5 K1", Kind::NotAllowed(words::name(slot(b'K'))), 1, 11);
    refused("G4", Kind::WordMissing(40, Needs::Time), 1, 1);
    refused("G4 T-1", Kind::NotPositive(words::name(slot(b'T'))), 1, 4);
    refused("G1 X1 R5", Kind::NotAllowed(words::name(slot(b'R'))), 1, 7);
    refused("G53 X1", Kind::NotAllowed(words::name(slot(b'X'))), 1, 5);
    refused("T1 M6", Kind::NotAllowed(words::name(slot(b'T'))), 1, 1);
    refused("N1.5 G1 X1", Kind::NotWhole(b'N'), 1, 1);
    refused("M1.5", Kind::NotWhole(b'M'), 1, 1);
    refused("M-1", Kind::NotWhole(b'M'), 1, 1);
    refused("G92", Kind::WordMissing(920, Needs::Axis), 1, 1);
}

#[test]
fn a_block_may_only_set_what_holds_from_now_on() {
    assert_eq!(good("G1 F20\nG0 G90 G17\n\n(note)\nN5\nF5").len(), 0);
    assert_eq!(good("G1 F20\nG0 G90\nX1")[0].iMoveType, MoveType::LINPOS);
    assert_eq!(good("G1 X1\nX1\nG91 X0").len(), 1, "a way of zero is no element");
}
