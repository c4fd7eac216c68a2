//! Rows of the table with operands in constants: what is folded must be what is computed.

use crate::table::{Cell, Line, Table, Unit, filled};
use crate::variables::{Array, START, describe, passing, program};
use std::collections::BTreeSet;
use std::fmt::Write;
use takt_compile::Options;
use takt_tests::bench;
use takt_tests::trial::{compiled, interpreted};

/// An expression of constants for bits of a type.
fn text(ty: &str, bits: u64) -> String {
    let real = |v: f64| match v {
        v if v.is_nan() => "0.0 / 0.0".into(),
        v if v.is_infinite() => format!("{}1.0E300 * 1.0E300", if v < 0.0 { "-" } else { "" }),
        v => format!("{v:?}").replace('e', "E"),
    };
    match ty {
        "BOOL" => if bits == 0 { "FALSE" } else { "TRUE" }.into(),
        "SINT" => (bits as i8).to_string(),
        "INT" => (bits as i16).to_string(),
        "DINT" => (bits as i32).to_string(),
        "LINT" => (bits as i64).to_string(),
        "REAL" => real(f32::from_bits(bits as u32).into()),
        "LREAL" => real(f64::from_bits(bits)),
        "LTIME" => format!("LINT_TO_LTIME({})", bits as i64),
        "TIME" | "DATE" | "TOD" | "DT" => format!("UDINT_TO_{ty}({bits})"),
        "LDATE" | "LTOD" | "LDT" => format!("ULINT_TO_{ty}({bits})"),
        _ => bits.to_string(),
    }
}

/// A row and its statement.
struct Row<'a> {
    unit: &'a Unit<'a>,
    line: &'a Line,
    row: usize,
    expression: String,
}

/// Some rows of each line; which ones differs from line to line.
fn rows<'a>(table: &Table, units: &[&'a Unit<'a>], wanted: impl Fn(Cell) -> bool, each: usize) -> Vec<Row<'a>> {
    let mut rows = Vec::new();
    for (n, unit) in units.iter().enumerate() {
        for (m, line) in unit.lines.iter().enumerate() {
            let fitting: Vec<usize> = (0..line.cells.len()).filter(|k| wanted(line.cells[*k])).collect();
            for k in 0..each.min(fitting.len()) {
                let row = fitting[(n * 31 + m * 7 + k * fitting.len() / each) % fitting.len()];
                let names: Vec<String> = unit
                    .operands
                    .iter()
                    .zip(table.indices(unit, row))
                    .map(|(list, i)| format!("c_{}_{i}", list.replace('.', "_")))
                    .collect();
                rows.push(Row { unit, line, row, expression: filled(&line.template, &names) });
            }
        }
    }
    rows
}

/// The constants of all lists that the units use.
fn constants(table: &Table, units: &[&Unit<'_>]) -> String {
    let lists: BTreeSet<&str> = units.iter().flat_map(|u| u.operands.iter().copied()).collect();
    let mut declared = String::from("VAR_GLOBAL CONSTANT\n");
    for list in lists {
        let ty = &table.lists[list].ty;
        for (i, bits) in table.lists[list].bits.iter().enumerate() {
            let _ = writeln!(declared, "  c_{}_{i} : {ty} := {};", list.replace('.', "_"), text(ty, *bits));
        }
    }
    declared + "END_VAR\n"
}

/// Runs rows of constants in both executors; how many, and what differs from the table.
pub fn run(table: &Table, units: &[&Unit<'_>]) -> (usize, Vec<String>) {
    let rows = rows(table, units, |c| matches!(c, Cell::Bits(_)), 3);
    let (mut globals, mut body) = (String::new(), String::new());
    for (n, row) in rows.iter().enumerate() {
        let _ = writeln!(globals, "  r{n} : ARRAY[0..0] OF {};", row.line.target);
        let _ = writeln!(body, "r{n}[0] := {};", row.expression);
    }
    let head = passing(units) + &constants(table, units);
    let source = format!("{head}VAR_GLOBAL\n{globals}END_VAR\nPROGRAM main\n{body}END_PROGRAM\n");
    let program = match program(&source, units[0].iec) {
        Ok(program) => program,
        Err(wrong) => return (rows.len(), wrong),
    };
    let code = takt_jit::compile(&program).expect("machine code");
    let (a, b) = (interpreted(&program, START), compiled(&program, &code, START));
    let mut wrong = Vec::new();
    if a != b || a.fault.is_some() {
        wrong.push(format!("the executors differ, or fault: {:?} {:?}", a.fault, b.fault));
    }
    for (n, row) in rows.iter().enumerate() {
        let found = Array::of(&program, &format!("r{n}")).get(&a.image, 0);
        if row.line.cells[row.row] != Cell::Bits(found) {
            wrong.push(describe(table, row.unit, row.line, row.row, &format!("constants: found {found:x}")));
        }
    }
    (rows.len(), wrong)
}

/// Divisions by a constant zero are reported, each where it is.
pub fn refused(table: &Table, units: &[&Unit<'_>]) -> Vec<String> {
    let mut rows = rows(table, units, |c| c == Cell::Fault, 1);
    rows.retain(|row| !row.expression.contains("pass_"));
    let mut source = constants(table, units);
    let _ = write!(source, "PROGRAM main VAR");
    for (n, row) in rows.iter().enumerate() {
        let _ = write!(source, " r{n} : {};", row.line.target);
    }
    source.push_str(" END_VAR\n");
    let first = source.matches('\n').count() + 1;
    for (n, row) in rows.iter().enumerate() {
        let _ = writeln!(source, "r{n} := {};", row.expression);
    }
    source.push_str("END_PROGRAM\n");
    let output = bench::compile_with(&source, &Options { iec_arithmetic: units[0].iec, ..Options::default() });
    let reported: BTreeSet<usize> = bench::found(&output).iter().filter(|d| d.code == "E0313").map(|d| d.line).collect();
    let missing = rows.iter().enumerate().filter(|(n, _)| !reported.contains(&(first + n)));
    missing.map(|(_, row)| describe(table, row.unit, row.line, row.row, "constants: not reported")).collect()
}
