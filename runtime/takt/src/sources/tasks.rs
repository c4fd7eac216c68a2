//! Tasks of foreign projects: what they say, and the CONFIGURATION that says it in ST.

use super::layout::Writer;
use super::xml::Element;
use std::ops::Range;
use takt_syntax::Code;

/// A task.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    /// Which of the writer's files it stands in.
    pub file: usize,
    /// Its name, usable in ST.
    pub name: String,
    /// Where the name stands.
    pub at: Range<usize>,
    /// Arguments of TASK and where they stand.
    pub arguments: Vec<(String, Range<usize>)>,
    /// Instance, program, and where they stand.
    pub programs: Vec<(String, String, Range<usize>)>,
}

/// Writes a CONFIGURATION with these tasks; none, nothing.
pub(super) fn write(name: &str, plans: &[Plan], writer: &mut Writer) {
    let (Some(first), Some(last)) = (plans.first(), plans.last()) else { return };
    writer.unit(name);
    writer.select(first.file);
    writer.put_line(&format!("CONFIGURATION {name}"), first.at.clone());
    for plan in plans {
        writer.select(plan.file);
        writer.put_indented(&format!("TASK {}(", plan.name), plan.at.clone());
        for (i, (argument, at)) in plan.arguments.iter().enumerate() {
            writer.put(if i > 0 { ", " } else { "" }, at.clone());
            writer.put(argument, at.clone());
        }
        writer.put(");", plan.at.clone());
        for (instance, program, at) in &plan.programs {
            writer.put_indented(&format!("PROGRAM {instance} WITH {} : {program};", plan.name), at.clone());
        }
    }
    writer.put_line("END_CONFIGURATION", last.at.clone());
}

/// A task of TwinCAT (`.TcTTO`): its period is in microseconds.
pub(super) fn of_twincat(root: &Element<'_>, file: usize, writer: &mut Writer) -> Option<Plan> {
    let Some(task) = root.child("Task").filter(|_| root.name == "TcPlcObject") else {
        let message = "expected <TcPlcObject> with a <Task>".to_string();
        writer.refuse(Code::BadFile, root.open.clone(), message, "export the file again from TwinCAT XAE");
        return None;
    };
    let (name, at) = name_of(task);
    let mut plan = Plan { file, name, at, arguments: Vec::new(), programs: Vec::new() };
    if let Some(cycle) = task.child("CycleTime") {
        match cycle.text().parse::<i64>() {
            Ok(us) if us >= 0 => plan.arguments.push((format!("INTERVAL := {}", literal(us.saturating_mul(1000))), cycle.text_place())),
            _ => refuse_number(cycle.text_place(), "a cycle time in microseconds", &cycle.text(), writer),
        }
    }
    if let Some(priority) = task.child("Priority") {
        push_priority(&mut plan, &priority.text(), priority.text_place(), writer);
    }
    let calls = || task.children().filter(|call| call.name == "PouCall").filter_map(|call| call.child("Name"));
    for call in calls() {
        let program = call.text();
        if program.contains('.') {
            writer.select(file);
            writer.left(
                &call.text_place(),
                &format!("the call of `{program}`"),
                "the program belongs to a library that Takt does not have",
            );
        } else {
            plan.programs.push((ident(&program), ident(&program), call.text_place()));
        }
    }
    (!plan.programs.is_empty() || calls().next().is_none()).then_some(plan)
}

/// A task of PLCopen XML, with CODESYS' settings where they are.
pub(super) fn of_plcopen(task: &Element<'_>, writer: &mut Writer) -> Plan {
    let (name, at) = name_of(task);
    let mut plan = Plan { file: 0, name, at, arguments: Vec::new(), programs: Vec::new() };
    let settings = super::plcopen::data(task, "tasksettings").and_then(|data| data.child("TaskSettings"));
    trigger(task, settings, &mut plan, writer);
    if let Some(priority) = task.attribute("priority") {
        push_priority(&mut plan, &priority.value, priority.at.clone(), writer);
    }
    if let Some(watchdog) = settings.and_then(|s| s.child("Watchdog")).filter(|w| w.value("Enabled") == Some("true")) {
        let reason = format!("a time limit belongs to the machine: give it as `watchdog` under [task.{}] in takt.toml", plan.name);
        writer.left(&watchdog.open, &format!("the watchdog of the task `{}`", plan.name), &reason);
    }
    for instance in task.children().filter(|child| child.name == "pouInstance") {
        let (name, at) = name_of(instance);
        // CODESYS leaves the type empty and gives the program as the name.
        let program = instance.value("typeName").filter(|ty| !ty.is_empty()).map_or_else(|| name.clone(), ident);
        plan.programs.push((name, program, at));
    }
    plan
}

fn trigger(task: &Element<'_>, settings: Option<&Element<'_>>, plan: &mut Plan, writer: &mut Writer) {
    let kind = settings.and_then(|s| s.value("KindOfTask")).unwrap_or("Cyclic");
    let event = settings.and_then(|s| s.attribute("Event")).or_else(|| task.attribute("single")).filter(|e| !e.value.is_empty());
    match (kind, event) {
        ("Freewheeling", _) => return,
        (_, Some(event)) if kind != "Cyclic" || task.attribute("interval").is_none() => {
            return plan.arguments.push((format!("SINGLE := {}", event.value), event.at.clone()));
        }
        _ => {}
    }
    let unit = settings.and_then(|s| s.value("IntervalUnit")).unwrap_or("ms");
    let Some(interval) = settings.and_then(|s| s.attribute("Interval")).or_else(|| task.attribute("interval")) else { return };
    match nanoseconds(&interval.value, unit) {
        Some(ns) => plan.arguments.push((format!("INTERVAL := {}", literal(ns)), interval.at.clone())),
        None => refuse_number(interval.at.clone(), "a time such as T#10ms or PT0.01S", &interval.value, writer),
    }
}

fn push_priority(plan: &mut Plan, text: &str, at: Range<usize>, writer: &mut Writer) {
    match text.parse::<u32>() {
        Ok(priority) => plan.arguments.push((format!("PRIORITY := {priority}"), at)),
        Err(_) => refuse_number(at, "a priority", text, writer),
    }
}

fn refuse_number(at: Range<usize>, expected: &str, found: &str, writer: &mut Writer) {
    writer.refuse(Code::BadFile, at, format!("expected {expected}, found `{found}`"), "correct the task and export it again");
}

fn name_of(element: &Element<'_>) -> (String, Range<usize>) {
    match element.attribute("name") {
        Some(name) => (ident(&name.value), name.at.clone()),
        None => (ident(""), element.open.clone()),
    }
}

/// A name that ST takes: what a tool shows may have blanks in it.
pub(super) fn ident(name: &str) -> String {
    let mut ident: String = name.trim().chars().map(|c| if c.is_alphanumeric() || c == '_' { c } else { '_' }).collect();
    if ident.is_empty() || ident.starts_with(|c: char| c.is_ascii_digit()) {
        ident.insert(0, '_');
    }
    ident
}

/// A duration in ST.
fn literal(ns: i64) -> String {
    match ns {
        ns if ns % 1_000_000 == 0 => format!("T#{}ms", ns / 1_000_000),
        ns if ns % 1000 == 0 => format!("LTIME#{}us", ns / 1000),
        ns => format!("LTIME#{ns}ns"),
    }
}

/// Reads `T#1s500ms`, `PT0.01S`, `10ms`, or `10` of a unit.
fn nanoseconds(text: &str, unit: &str) -> Option<i64> {
    let text = text.trim().to_ascii_lowercase().replace('_', "");
    let text = text.rsplit_once('#').map_or(text.as_str(), |(_, time)| time);
    // ISO 8601 marks where the time begins: `P1DT1H`.
    let text = text.strip_prefix('p').map_or_else(|| text.to_string(), |iso| iso.replace('t', ""));
    if let Ok(number) = text.parse::<f64>() {
        return in_nanoseconds(number, unit);
    }
    let mut rest = text.as_str();
    let mut sum = 0_i64;
    while !rest.is_empty() {
        let digits = rest.find(|c: char| !c.is_ascii_digit() && c != '.')?;
        let (number, behind) = rest.split_at(digits);
        let letters = behind.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(behind.len());
        sum = sum.checked_add(in_nanoseconds(number.parse().ok()?, &behind[..letters])?)?;
        rest = &behind[letters..];
    }
    (!text.is_empty()).then_some(sum)
}

fn in_nanoseconds(number: f64, unit: &str) -> Option<i64> {
    let factor = match unit {
        "d" => 86_400e9,
        "h" => 3600e9,
        "m" | "min" => 60e9,
        "s" => 1e9,
        "ms" => 1e6,
        "us" | "µs" => 1e3,
        "ns" => 1.0,
        _ => return None,
    };
    let ns = (number * factor).round();
    (0.0..=1e18).contains(&ns).then_some(ns as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_of_every_tool_are_read() {
        let ns = |text: &str| nanoseconds(text, "ms");
        assert_eq!(
            (ns("PT0.01S"), ns("t#10ms"), ns("10"), ns("T#1s500ms")),
            (Some(10_000_000), Some(10_000_000), Some(10_000_000), Some(1_500_000_000))
        );
        assert_eq!(
            (ns("LTIME#250us"), ns("PT1M0.5S"), ns("P1DT1H"), ns("PT0S")),
            (Some(250_000), Some(60_500_000_000), Some(90_000_000_000_000), Some(0))
        );
        assert_eq!((ns("soon"), ns(""), ns("10 parsecs"), ns("-1"), ns("1e300d")), (None, None, None, None, None));
        assert_eq!(nanoseconds("250", "us"), Some(250_000));
        assert_eq!((literal(10_000_000), literal(250_000), literal(7)), ("T#10ms".into(), "LTIME#250us".into(), "LTIME#7ns".into()));
    }

    #[test]
    fn names_of_tasks_become_names_of_st() {
        assert_eq!(
            (ident("Main Task"), ident("1st"), ident(""), ident("主任务")),
            ("Main_Task".into(), "_1st".into(), "_".into(), "主任务".into())
        );
    }
}
