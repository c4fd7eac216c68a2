//! The table with operands in variables: locals of a function and elements of arrays.

use crate::table::{Cell, Line, List, Table, Unit, filled};
use std::collections::BTreeSet;
use std::fmt::Write;
use takt_compile::Options;
use takt_ir::Program;
use takt_tests::bench;
use takt_tests::trial::{Start, compiled, interpreted};

/// More than any of these programs needs.
pub const START: Start = Start { scans: 1, fuel: 1 << 40, slow_polls: 0, flag: 0, depth_limit: 100, stack: 1 << 20 };

const INTEGERS: [&str; 12] = ["BYTE", "WORD", "DWORD", "LWORD", "SINT", "INT", "DINT", "LINT", "USINT", "UINT", "UDINT", "ULINT"];

const LETTERS: [&str; 3] = ["a", "b", "c"];

/// A program that computes all rows of the units.
pub fn source(table: &Table, units: &[&Unit<'_>]) -> String {
    let mut globals = String::new();
    let lists: BTreeSet<&str> = units.iter().flat_map(|u| u.operands.iter().copied()).collect();
    for list in lists {
        let (name, List { ty, bits }) = (list.replace('.', "_"), &table.lists[list]);
        let _ = writeln!(globals, "  v_{name} : ARRAY[0..{}] OF {ty};", bits.len() - 1);
    }
    let mut functions = String::new();
    let mut calls = String::new();
    for (n, unit) in units.iter().enumerate() {
        for (m, line) in unit.lines.iter().enumerate() {
            let last = line.cells.len() - 1;
            let _ = writeln!(globals, "  r{n}_{m}, q{n}_{m} : ARRAY[0..{last}] OF {}; ok{n}_{m} : ARRAY[0..{last}] OF BOOL;", line.target);
        }
        functions.push_str(&function(table, n, unit));
        let _ = writeln!(calls, "u{n}();");
    }
    format!("{}VAR_GLOBAL\n{globals}END_VAR\n{functions}PROGRAM main\n{calls}END_PROGRAM\n", passing(units))
}

/// The functions `pass_INT`, … that the units call: they give back what is passed to them.
pub fn passing(units: &[&Unit<'_>]) -> String {
    let used = |ty: &&&str| units.iter().flat_map(|u| &u.lines).any(|l| l.template.contains(&format!("pass_{ty}(")));
    let function = |ty: &&str| format!("FUNCTION pass_{ty} : {ty} VAR_INPUT x : {ty}; END_VAR\npass_{ty} := x;\nEND_FUNCTION\n");
    INTEGERS.iter().filter(used).map(function).collect()
}

/// Loops over the operands of a unit; each line is computed from locals and from elements of arrays.
fn function(table: &Table, n: usize, unit: &Unit<'_>) -> String {
    let mut text = format!("FUNCTION u{n} : BOOL\nVAR k : DINT;");
    let mut elements = Vec::new();
    let (mut heads, mut ends) = (String::new(), String::new());
    for (letter, list) in LETTERS.iter().zip(&unit.operands) {
        let List { ty, bits } = &table.lists[*list];
        let element = format!("v_{}[i{letter}]", list.replace('.', "_"));
        let _ = write!(text, " i{letter} : DINT; {letter} : {ty};");
        let _ = writeln!(heads, "FOR i{letter} := 0 TO {} DO {letter} := {element};", bits.len() - 1);
        ends.push_str(" END_FOR");
        elements.push(element);
    }
    let locals: Vec<String> = LETTERS.iter().map(|l| l.to_string()).collect();
    let _ = write!(text, " END_VAR\n{heads}");
    for (m, line) in unit.lines.iter().enumerate() {
        let mask = line.cells.contains(&Cell::Fault);
        let (local, element) = (filled(&line.template, &locals), filled(&line.template, &elements));
        let both = format!("r{n}_{m}[k] := {local}; q{n}_{m}[k] := {element};");
        let _ = if mask { writeln!(text, "IF ok{n}_{m}[k] THEN {both} END_IF") } else { writeln!(text, "{both}") };
    }
    let _ = writeln!(text, "k := k + 1;{ends}\nEND_FUNCTION");
    text
}

/// A global array of the program.
#[derive(Clone, Copy)]
pub struct Array {
    offset: usize,
    size: usize,
}

impl Array {
    /// The array of that name.
    pub fn of(program: &Program, name: &str) -> Self {
        let first = takt_ir::resolve(program, &format!("{name}[0]")).unwrap_or_else(|e| panic!("{name}: {e}"));
        Self { offset: first.offset as usize, size: program.types.size(first.ty) as usize }
    }
    /// The bits of an element in an image.
    pub fn get(self, image: &[u8], index: usize) -> u64 {
        let at = self.offset + index * self.size;
        let mut bytes = [0; 8];
        bytes[..self.size].copy_from_slice(&image[at..at + self.size]);
        u64::from_le_bytes(bytes)
    }
    fn put(self, image: &mut [u8], index: usize, bits: u64) {
        let at = self.offset + index * self.size;
        image[at..at + self.size].copy_from_slice(&bits.to_le_bytes()[..self.size]);
    }
}

/// Compiles, and makes room for what the program starts with; else the lines that the compiler refuses.
pub fn program(source: &str, iec: bool) -> Result<Program, Vec<String>> {
    let output = bench::compile_with(source, &Options { iec_arithmetic: iec, ..Options::default() });
    let lines: Vec<&str> = source.lines().collect();
    let errors = bench::found(&output).into_iter().filter(|d| d.code.starts_with('E'));
    let shown: Vec<String> = errors.map(|d| format!("{} {}: {}", d.code, d.text, lines[d.line - 1])).collect();
    let mut program = output.program.ok_or(shown)?;
    takt_ir::verify(&program).map_err(|e| vec![e.to_string()])?;
    program.init.resize(program.image_size as usize, 0);
    Ok(program)
}

/// Runs units in both executors; what differs from the table.
pub fn run(table: &Table, units: &[&Unit<'_>]) -> Vec<String> {
    let mut program = match program(&source(table, units), units[0].iec) {
        Ok(program) => program,
        Err(wrong) => return wrong,
    };
    let lists: BTreeSet<&str> = units.iter().flat_map(|u| u.operands.iter().copied()).collect();
    for list in lists {
        let array = Array::of(&program, &format!("v_{}", list.replace('.', "_")));
        for (i, bits) in table.lists[list].bits.iter().enumerate() {
            array.put(&mut program.init, i, *bits);
        }
    }
    for (n, unit) in units.iter().enumerate() {
        for (m, line) in unit.lines.iter().enumerate().filter(|(_, l)| l.cells.contains(&Cell::Fault)) {
            let array = Array::of(&program, &format!("ok{n}_{m}"));
            for (k, cell) in line.cells.iter().enumerate() {
                array.put(&mut program.init, k, u64::from(*cell != Cell::Fault));
            }
        }
    }
    let code = takt_jit::compile(&program).expect("machine code");
    let (a, b) = (interpreted(&program, START), compiled(&program, &code, START));
    let mut wrong = Vec::new();
    if a != b || a.fault.is_some() {
        wrong.push(format!("the executors differ, or fault: {:?} {:?}", (a.fault, a.site), (b.fault, b.site)));
    }
    for (n, unit) in units.iter().enumerate() {
        for (m, line) in unit.lines.iter().enumerate() {
            for (form, name) in [("locals", format!("r{n}_{m}")), ("elements", format!("q{n}_{m}"))] {
                let array = Array::of(&program, &name);
                for (k, cell) in line.cells.iter().enumerate() {
                    let found = array.get(&a.image, k);
                    if matches!(cell, Cell::Bits(expected) if *expected != found) {
                        wrong.push(describe(table, unit, line, k, &format!("{form}: found {found:x}")));
                    }
                }
            }
        }
    }
    wrong
}

/// A row for people.
pub fn describe(table: &Table, unit: &Unit<'_>, line: &Line, row: usize, found: &str) -> String {
    let operands: Vec<String> = unit
        .operands
        .iter()
        .zip(table.indices(unit, row))
        .map(|(list, i)| format!("{}#{:x}", table.lists[*list].ty, table.lists[*list].bits[i]))
        .collect();
    let arithmetic = if unit.iec { "iec" } else { "codesys" };
    format!("{arithmetic}: {} := {}: expected {:x?}, {found}", line.target, filled(&line.template, &operands), line.cells[row])
}

/// A program with an arm for each line that has a division by zero; each is run by itself. The number of lines, and what differs.
pub fn faults(table: &Table, units: &[&Unit<'_>]) -> (usize, Vec<String>) {
    let (mut globals, mut arms, mut rows) = (String::new(), String::new(), Vec::new());
    for unit in units {
        for line in &unit.lines {
            let Some(row) = line.cells.iter().position(|c| *c == Cell::Fault) else { continue };
            let n = rows.len();
            let names: Vec<String> = (0..unit.operands.len()).map(|i| format!("x{n}_{i}[0]")).collect();
            for (i, list) in unit.operands.iter().enumerate() {
                let _ = writeln!(globals, "  x{n}_{i} : ARRAY[0..0] OF {};", table.lists[*list].ty);
            }
            let _ = writeln!(globals, "  y{n} : {};", line.target);
            let _ = writeln!(arms, "  {n}: y{n} := {};", filled(&line.template, &names));
            rows.push((*unit, *line, row));
        }
    }
    if rows.is_empty() {
        return (0, Vec::new());
    }
    let functions = passing(units);
    let source = format!(
        "{functions}VAR_GLOBAL\n  which : ARRAY[0..0] OF DINT;\n{globals}END_VAR\nPROGRAM main\nCASE which[0] OF\n{arms}END_CASE\nEND_PROGRAM\n"
    );
    let mut program = match program(&source, units[0].iec) {
        Ok(program) => program,
        Err(wrong) => return (rows.len(), wrong),
    };
    for (n, (unit, _, row)) in rows.iter().enumerate() {
        for (i, (list, index)) in unit.operands.iter().zip(table.indices(unit, *row)).enumerate() {
            Array::of(&program, &format!("x{n}_{i}")).put(&mut program.init, 0, table.lists[*list].bits[index]);
        }
    }
    let (code, which) = (takt_jit::compile(&program).expect("machine code"), Array::of(&program, "which"));
    let mut wrong = Vec::new();
    for (n, (unit, line, row)) in rows.iter().enumerate() {
        which.put(&mut program.init, 0, n as u64);
        let (a, b) = (interpreted(&program, START), compiled(&program, &code, START));
        if a != b || a.fault != Some(takt_abi::Fault::DivisionByZero) {
            wrong.push(describe(table, unit, line, *row, &format!("found {:?} and {:?}", a.fault, b.fault)));
        }
    }
    (rows.len(), wrong)
}
