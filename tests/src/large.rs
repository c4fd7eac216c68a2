//! Large programs, for measurements and limits: as many lines as asked for, the same ones every time.

use std::fmt::Write;

/// Lines of one cell with its share of a station.
const CELL: usize = 124;

/// Cells that one program calls.
const STATION: usize = 100;

/// A program of about `lines` lines of realistic Structured Text: cells of an enumeration, structures, globals, a function, an interface, blocks that
/// extend each other with methods and properties, and a PROGRAM for each hundred cells, called by PLC_PRG. A cell uses what a cell before it declares.
pub fn program(lines: usize) -> String {
    let cells = (lines / CELL).max(1);
    let mut text = String::with_capacity(cells * 4_000);
    text.push_str("INTERFACE I_Drive\nMETHOD Advance : LREAL\nVAR_INPUT delta : LREAL; END_VAR\nEND_METHOD\nEND_INTERFACE\n\n");
    for n in 0..cells {
        text.push_str(&cell(n));
    }
    for first in (0..cells).step_by(STATION) {
        station(&mut text, first, (first + STATION).min(cells));
    }
    text.push_str("PROGRAM PLC_PRG\n");
    for first in (0..cells).step_by(STATION) {
        let _ = writeln!(text, "Station{first}();");
    }
    text.push_str("END_PROGRAM\n");
    text
}

/// What cell `n` declares.
fn cell(n: usize) -> String {
    let before = n.saturating_sub(1 + n % 7);
    let scale = n % 90 + 10;
    include_str!("large/cell.st").replace("$N", &n.to_string()).replace("$B", &before.to_string()).replace("$S", &scale.to_string())
}

/// The program that calls the cells from `first` to before `end`.
fn station(text: &mut String, first: usize, end: usize) {
    let _ = writeln!(text, "PROGRAM Station{first}\nVAR\n    drive : I_Drive;\n    run : BOOL := TRUE;\n    level, total : LREAL;");
    for n in first..end {
        let _ = writeln!(text, "    pump{n} : FB_Pump{n};");
    }
    let _ = writeln!(text, "END_VAR");
    for n in first..end {
        let _ = writeln!(text, "pump{n}(enable := run, setpoint := {n}.5, recipe := gRecipe{n}, level => level);");
        let _ = writeln!(text, "drive := pump{n};");
        let _ = writeln!(text, "total := total + drive.Advance({}) + pump{n}.Average;", n % 11);
    }
    let _ = writeln!(text, "END_PROGRAM\n");
}
