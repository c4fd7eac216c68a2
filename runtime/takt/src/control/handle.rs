//! What each request means.

use super::answer::{self, Named, Problem, bad, good};
use super::hold::{Hold, Way};
use super::job::{self, Change, Item, Job, Sampler, Span, Status, Work};
use super::request::{self, Assignment, Kind as ResetKind, Request};
use super::server::{Kind, Note, Pending, Server, Target, Who, done, update_line};
use super::session::{Armed, Rhythm, Subscription};
use super::{NAME, VERSION, limits};
use crate::journal::{Entry, Event, clean};
use crate::machine::variable;
use crate::parameters;
use serde_json::{Value, json};
use std::collections::HashSet;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};
use takt_engine::{Command, Reset};
use takt_ir::{Place, TypeId, format_value};

/// Scans that may be stepped at once.
const STEPS: u64 = 1_000_000;

/// Variables to be copied.
type Copied = (Arc<[Named]>, Arc<[Span]>);

impl Server {
    /// A line of a client.
    pub fn handle(&mut self, client: u64, line: &[u8]) {
        let line = line.trim_ascii();
        if line.is_empty() {
            return;
        }
        let (id, request) = request::parse(line);
        let outcome = request.and_then(|request| self.permit(client, &request).and_then(|()| self.begin(client, &id, request)));
        if let Err(problem) = outcome {
            self.send(Some(client), &bad(&id, &problem));
        }
    }

    /// Whether a client may ask for this.
    fn permit(&self, client: u64, request: &Request) -> Result<(), Problem> {
        let Some(session) = self.sessions.get(&client) else { return Ok(()) };
        if !session.greeted && !matches!(request, Request::Hello { .. }) {
            let problem = Problem::new("hello-first", "the first request is hello");
            return Err(problem.expected(format!("{{\"id\":1,\"request\":\"hello\",\"version\":{VERSION}}}")));
        }
        if request.changes() && session.armed.is_none() {
            let problem = Problem::new("not-armed", "this connection only looks; nothing may be changed");
            return Err(problem.expected(r#"{"id":1,"request":"arm","name":"who","reason":"why"} before"#));
        }
        Ok(())
    }

    fn begin(&mut self, client: u64, id: &Value, request: Request) -> Result<(), Problem> {
        match request {
            Request::Hello { version, client: program } => self.hello(client, id, version, &program),
            Request::Arm { name, reason } => self.arm(client, id, &name, &reason),
            Request::Disarm {} => self.disarm(client, id),
            Request::Status {} => self.ask_status(client, id, Kind::Status),
            Request::Tasks {} => self.ask_status(client, id, Kind::Tasks),
            Request::Forces {} => self.ask_status(client, id, Kind::Forces),
            Request::Parameters {} => self.parameters(client, id),
            Request::Read { variables } => {
                let (names, spans) = self.copied(&variables)?;
                let bytes = job::bytes(&spans);
                self.demand(client, id, Work::Read { spans, bytes }, Kind::Read(names.to_vec()));
                Ok(())
            }
            Request::Write { variables, lease_ms } => self.assign(client, id, &variables, lease_ms, false),
            Request::Force { variables, lease_ms } => self.assign(client, id, &variables, lease_ms, true),
            Request::Renew {} => {
                let held = self.holds.renew(client, Instant::now());
                self.send(Some(client), &good(id, json!({ "held": held })));
                Ok(())
            }
            Request::Release { variables, restore } => self.release(client, id, &variables, restore),
            Request::ReleaseAll { restore } => {
                self.command(client, id, Event::Release, vec![], vec![Command::ReleaseAll { restore }], None);
                Ok(())
            }
            Request::Subscribe { variables, period_ms, scans } => self.subscribe(client, id, &variables, period_ms, scans),
            Request::Unsubscribe { subscription } => self.unsubscribe(client, id, subscription),
            Request::Reset { kind } => self.reset(client, id, kind),
            Request::ResetTask { task } => self.reset_task(client, id, &task),
            Request::Halt {} => {
                self.command(client, id, Event::Control, vec![], vec![Command::Halt], None);
                Ok(())
            }
            Request::ResetStatistics {} => {
                self.demand(client, id, Work::ResetStatistics, Kind::Statistics);
                Ok(())
            }
            Request::Pause {} => self.change(client, id, Change::Pause),
            Request::Continue {} => self.change(client, id, Change::Continue),
            Request::Stop {} => self.change(client, id, Change::Stop),
            Request::Step { scans } if (1..=STEPS).contains(&scans) => self.change(client, id, Change::Step(scans)),
            Request::Step { scans } => {
                Err(Problem::new("out-of-range", format!("{scans} scans cannot be stepped")).expected(format!("1 to {STEPS}")))
            }
        }
    }

    fn hello(&mut self, client: u64, id: &Value, version: u32, program: &str) -> Result<(), Problem> {
        if version != VERSION {
            let problem = Problem::new("wrong-version", format!("version {version} of the protocol is not spoken here"));
            return Err(problem.expected(format!("version {VERSION}")));
        }
        if let Some(session) = self.sessions.get_mut(&client) {
            session.greeted = true;
            session.program = clean(program).chars().take(limits::NAME).collect();
        }
        let about = json!({
            "protocol": "takt-control", "version": VERSION, "takt": env!("CARGO_PKG_VERSION"), "socket": NAME,
            "project": self.about.project, "process": std::process::id(), "real_time": self.about.real_time,
            "limits": {
                "request_bytes": limits::LINE, "answer_bytes": limits::ANSWER, "requests": limits::REQUESTS,
                "variables": limits::VARIABLES, "variable_bytes": limits::BYTES, "subscriptions": limits::SUBSCRIPTIONS,
            },
        });
        self.send(Some(client), &good(id, about));
        Ok(())
    }

    fn arm(&mut self, client: u64, id: &Value, name: &str, reason: &str) -> Result<(), Problem> {
        let (name, reason) = (clean(name.trim()), clean(reason.trim()));
        for (what, text) in [("name", &name), ("reason", &reason)] {
            let count = text.chars().count();
            if count == 0 || count > limits::NAME {
                let problem = Problem::new("out-of-range", format!("the {what} has {count} characters"));
                return Err(problem.expected(format!("1 to {}", limits::NAME)));
            }
        }
        if let Some(session) = self.sessions.get_mut(&client) {
            session.armed = Some(Armed { name, reason });
        }
        let who = self.who(client);
        self.post(Entry::new(Event::Arm).by(&who.name, &who.from, &who.reason));
        self.send(Some(client), &done(id));
        Ok(())
    }

    fn disarm(&mut self, client: u64, id: &Value) -> Result<(), Problem> {
        let who = self.who(client);
        let held = self.holds.of_client(client);
        held.iter().for_each(|hold| self.let_go(hold, "its client was disarmed"));
        if let Some(session) = self.sessions.get_mut(&client)
            && session.armed.take().is_some()
        {
            self.post(Entry::new(Event::Disarm).by(&who.name, &who.from, ""));
        }
        self.send(Some(client), &good(id, json!({ "released": held.len() })));
        Ok(())
    }

    fn who(&self, client: u64) -> Who {
        let session = self.sessions.get(&client);
        session.map_or_else(Who::default, |session| Who { name: session.who(), from: session.from(), reason: session.reason().into() })
    }

    fn demand(&mut self, client: u64, id: &Value, work: Work, kind: Kind) {
        let who = self.who(client);
        self.ask(work, Pending { client: Some(client), id: id.clone(), kind, who });
    }

    fn ask_status(&mut self, client: u64, id: &Value, kind: Kind) -> Result<(), Problem> {
        let status = Status::new(self.about.program.tasks.len());
        self.demand(client, id, Work::Status(Box::new(status)), kind);
        Ok(())
    }

    /// Variables to be copied, by their names.
    fn copied(&self, paths: &[String]) -> Result<Copied, Problem> {
        let count = paths.len();
        if count == 0 || count > limits::VARIABLES {
            return Err(Problem::new("out-of-range", format!("{count} variables")).expected(format!("1 to {}", limits::VARIABLES)));
        }
        let program = &self.about.program;
        let (mut names, mut spans) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let mut bytes = 0;
        for path in paths {
            let place =
                takt_ir::resolve(program, path).map_err(|error| Problem::variable(&crate::machine::VariableError::Name(error), path))?;
            let span = job::span(program, place).map_err(|error| Problem::new("too-large", format!("{path}: {error}")))?;
            bytes += span.len as usize;
            names.push(Named { name: path.clone(), ty: place.ty, len: span.len as usize });
            spans.push(span);
        }
        if bytes > limits::BYTES {
            return Err(
                Problem::new("too-large", format!("the variables have {bytes} bytes")).expected(format!("{} at the most", limits::BYTES))
            );
        }
        Ok((names.into(), spans.into()))
    }

    /// The PERSISTENT variables.
    fn parameters(&mut self, client: u64, id: &Value) -> Result<(), Problem> {
        let list = parameters::list(&self.about.program).map_err(|message| Problem::new("too-large", message))?;
        let names: Vec<String> = list.into_iter().map(|parameter| parameter.path).collect();
        if names.is_empty() {
            self.send(Some(client), &good(id, json!({ "parameters": [] })));
            return Ok(());
        }
        let (names, spans) = self.copied(&names)?;
        let bytes = job::bytes(&spans);
        self.demand(client, id, Work::Read { spans, bytes }, Kind::Parameters(names.to_vec()));
        Ok(())
    }

    fn lease(lease_ms: Option<u64>) -> Result<Option<Duration>, Problem> {
        match lease_ms {
            Some(time) if !limits::PERIOD_MS.contains(&time) => Err(out_of_period("lease", time)),
            time => Ok(time.map(Duration::from_millis)),
        }
    }

    /// Writes and forces.
    fn assign(&mut self, client: u64, id: &Value, list: &[Assignment], lease_ms: Option<u64>, force: bool) -> Result<(), Problem> {
        let lease = Self::lease(lease_ms)?;
        let count = list.len();
        if count == 0 || count > limits::VARIABLES {
            return Err(Problem::new("out-of-range", format!("{count} variables")).expected(format!("1 to {}", limits::VARIABLES)));
        }
        if lease.is_some() && !self.holds.room_for(count) {
            return Err(Problem::new("too-many", format!("no more than {} variables can be held", limits::HOLDS)));
        }
        let (mut targets, mut commands) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let mut seen = HashSet::new();
        for assignment in list {
            let (place, bytes) = self.value(assignment)?;
            if !seen.insert(place.offset) {
                return Err(Problem::new("bad-request", format!("{} is named twice", assignment.variable)));
            }
            if self.holds.by_other(client, place) {
                return Err(Problem::new("held", format!("{} is held by another client", assignment.variable)));
            }
            targets.push(Target { name: assignment.variable.clone(), place });
            commands.push(if force { Command::Force { place, bytes } } else { Command::Write { place, bytes } });
        }
        let event = if force { Event::Force } else { Event::Write };
        self.command(client, id, event, targets, commands, lease);
        Ok(())
    }

    fn value(&self, assignment: &Assignment) -> Result<(Place, Box<[u8]>), Problem> {
        let (program, path) = (&self.about.program, &assignment.variable);
        let place = variable::writable(program, path).map_err(|error| Problem::variable(&error, path))?;
        let literal = match (&assignment.value, &assignment.literal) {
            (Some(value), None) => answer::literal(program, place.ty, value),
            (None, Some(literal)) => Some(literal.clone()),
            _ => None,
        };
        let expected = "either \"value\" with a number, a text or a truth, or \"literal\" with a literal of ST";
        let literal = literal.ok_or_else(|| Problem::new("bad-value", format!("{path}: there is no value")).expected(expected))?;
        let (place, bytes) = variable::assignment(program, path, &literal).map_err(|error| Problem::variable(&error, path))?;
        Ok((place, bytes))
    }

    fn release(&mut self, client: u64, id: &Value, paths: &[String], restore: bool) -> Result<(), Problem> {
        let program = self.about.program.clone();
        let (mut targets, mut commands) = (Vec::new(), Vec::new());
        for path in paths.iter().take(limits::VARIABLES) {
            let place = variable::writable(&program, path).map_err(|error| Problem::variable(&error, path))?;
            targets.push(Target { name: path.clone(), place });
            commands.push(Command::Release { place, restore });
        }
        if commands.is_empty() {
            return Err(Problem::new("out-of-range", "no variable is named").expected("variables, or release-all"));
        }
        self.command(client, id, Event::Release, targets, commands, None);
        Ok(())
    }

    fn reset(&mut self, client: u64, id: &Value, kind: ResetKind) -> Result<(), Problem> {
        let kind = match kind {
            ResetKind::Warm => Reset::Warm,
            ResetKind::Cold => Reset::Cold,
            ResetKind::Origin => Reset::Origin,
        };
        let command = Command::Reset(kind);
        self.command(client, id, Event::Reset, vec![], vec![command], None);
        Ok(())
    }

    fn reset_task(&mut self, client: u64, id: &Value, name: &str) -> Result<(), Problem> {
        let tasks = &self.about.program.tasks;
        let Some(task) = tasks.iter().position(|task| task.name.eq_ignore_ascii_case(name)) else {
            let known = tasks.iter().map(|task| task.name.as_str()).collect::<Vec<_>>().join(", ");
            return Err(Problem::new("unknown-task", format!("there is no task `{name}`")).expected(known));
        };
        self.command(client, id, Event::Reset, vec![], vec![Command::ResetTask(task as u32)], None);
        Ok(())
    }

    fn change(&mut self, client: u64, id: &Value, change: Change) -> Result<(), Problem> {
        let work = Work::Run { change, before: super::job::Mode::Running };
        self.demand(client, id, work, Kind::Run(change));
        Ok(())
    }

    fn command(&mut self, client: u64, id: &Value, event: Event, targets: Vec<Target>, commands: Vec<Command>, lease: Option<Duration>) {
        let work = self.commands(commands);
        self.demand(client, id, work, Kind::Commands { event, targets, lease, client });
    }

    /// Commands with room for what variables were and are.
    pub fn commands(&self, commands: Vec<Command>) -> Work {
        let room = |command: &Command| match command {
            Command::Write { place, .. } | Command::Force { place, .. } | Command::Release { place, .. } => {
                vec![0; self.about.program.types.size(place.ty) as usize].into_boxed_slice()
            }
            _ => Box::default(),
        };
        let list = commands.into_iter().map(|command| Item { old: room(&command), new: room(&command), command }).collect();
        Work::Commands { list, refused: None, done: 0, forces: 0 }
    }

    fn subscribe(&mut self, client: u64, id: &Value, paths: &[String], period: Option<u64>, scans: Option<u64>) -> Result<(), Problem> {
        let (names, spans) = self.copied(paths)?;
        let own = self.sessions.get(&client).map_or(0, |session| session.subscriptions.len());
        if own >= limits::SUBSCRIPTIONS || scans.is_some() && self.samplers.len() >= limits::SAMPLERS {
            let most = if scans.is_some() { limits::SAMPLERS } else { limits::SUBSCRIPTIONS };
            return Err(Problem::new("too-many", format!("{most} subscriptions are the most")));
        }
        let number = self.number();
        let row = job::length(&spans);
        let kind = match (period, scans) {
            (Some(period), None) if limits::PERIOD_MS.contains(&period) => {
                let bytes = job::bytes(&spans);
                let job = Box::new(Job::new(0, Work::Read { spans: spans.clone(), bytes }));
                Rhythm::Period { period: Duration::from_millis(period), next: Instant::now(), job: Some(job) }
            }
            (Some(period), None) => return Err(out_of_period("period", period)),
            (None, Some(every)) if (1..=STEPS).contains(&every) => {
                self.samplers.insert(number, client);
                let sampler = Sampler::new(number, spans.clone(), every, row);
                let kind = Kind::Nothing;
                self.pending.insert(number, Pending { client: None, id: Value::Null, kind, who: Who::default() });
                self.push(Box::new(Job::new(number, Work::Sample(Box::new(sampler)))));
                Rhythm::Scans
            }
            _ => {
                let problem = Problem::new("bad-request", "a subscription needs one of period_ms and scans");
                return Err(problem.expected(format!("\"period_ms\":100, or \"scans\":1 to {STEPS}")));
            }
        };
        if let Some(session) = self.sessions.get_mut(&client) {
            session.subscriptions.push(Subscription { id: number, names, spans, kind, missed: 0 });
        }
        self.send(Some(client), &good(id, json!({ "subscription": number })));
        Ok(())
    }

    fn unsubscribe(&mut self, client: u64, id: &Value, subscription: u64) -> Result<(), Problem> {
        let session = self.sessions.get_mut(&client);
        let found = session.and_then(|session| {
            let index = session.subscriptions.iter().position(|own| own.id == subscription)?;
            Some(session.subscriptions.swap_remove(index))
        });
        if found.is_none() {
            return Err(Problem::new("unknown-subscription", format!("this client has no subscription {subscription}")));
        }
        self.end_sampler(subscription);
        self.send(Some(client), &done(id));
        Ok(())
    }

    /// The port has done a job.
    pub fn finished(&mut self, pending: Pending, job: Job) {
        let Pending { client, id, kind, who } = pending;
        let Job { work, cycle, time, .. } = job;
        let stamp = |mut value: Value| {
            value["cycle"] = cycle.into();
            value["time_ns"] = time.0.into();
            value
        };
        match (kind, work) {
            (Kind::Read(names), Work::Read { bytes, .. }) => {
                let values = answer::values(&self.about.program, &names, &bytes);
                self.send(client, &good(&id, stamp(json!({ "values": values }))));
            }
            (Kind::Parameters(names), Work::Read { bytes, .. }) => {
                let mut rest = &bytes[..];
                let list = names.iter().map_while(|named| {
                    let (own, behind) = rest.split_at_checked(named.len)?;
                    rest = behind;
                    let literal = self.text(named.ty, own);
                    Some(json!({ "variable": named.name, "type": self.about.program.types.name(named.ty), "literal": literal }))
                });
                let list: Vec<Value> = list.collect();
                self.send(client, &good(&id, stamp(json!({ "parameters": list }))));
            }
            (Kind::Status, Work::Status(status)) => {
                let value = self.status(&status);
                self.send(client, &good(&id, stamp(value)));
            }
            (Kind::Tasks, Work::Status(status)) => {
                let tasks = answer::tasks(&self.about.program, &status);
                self.send(client, &good(&id, stamp(json!({ "tasks": tasks }))));
            }
            (Kind::Forces, Work::Status(status)) => {
                let forces = self.forces(&status);
                self.send(client, &good(&id, stamp(json!({ "forces": forces }))));
            }
            (Kind::Run(change), Work::Run { before, .. }) => {
                let what = match change {
                    Change::Pause => "pause".to_string(),
                    Change::Continue => "continue".into(),
                    Change::Stop => "stop".into(),
                    Change::Step(scans) => format!("step {scans}"),
                };
                self.post(Entry::new(Event::Control).at(time).message(what).by(&who.name, &who.from, &who.reason));
                self.send(client, &good(&id, stamp(json!({ "before": answer::mode(before) }))));
            }
            (Kind::Statistics, _) => self.send(client, &good(&id, stamp(json!({})))),
            (Kind::Update { subscription }, Work::Read { spans, bytes }) => {
                let job = Box::new(Job::new(0, Work::Read { spans, bytes }));
                self.updated(client, subscription, cycle, time.0, job);
            }
            (Kind::Commands { event, targets, lease, client: holder }, Work::Commands { list, refused, done, forces }) => {
                self.audit(event, &targets, &list[..done], &who, time);
                self.keep(&targets, &list[..done], &who);
                if let Some(lease) = lease {
                    self.hold(holder, event, &targets, &list[..done], lease);
                }
                let line = match refused {
                    None => good(&id, stamp(json!({ "done": done, "forces": forces }))),
                    Some(error) => {
                        let name = targets.get(done).map_or_else(String::new, |target| format!("{}: ", target.name));
                        let before = if done > 0 { format!("; the {done} before it are done") } else { String::new() };
                        bad(&id, &Problem::new("refused", format!("{name}{error}{before}")))
                    }
                };
                self.send(client, &line);
            }
            _ => {}
        }
    }

    fn updated(&mut self, client: Option<u64>, subscription: u64, cycle: u64, time_ns: i64, ready: Box<Job>) {
        let Some(session) = client.and_then(|client| self.sessions.get_mut(&client)) else { return };
        let Some(own) = session.subscriptions.iter_mut().find(|own| own.id == subscription) else { return };
        let mut line = String::new();
        if let Work::Read { bytes, .. } = &ready.work {
            let values = answer::values(&self.about.program, &own.names, bytes);
            line = update_line(subscription, cycle, time_ns, std::mem::take(&mut own.missed), values);
        }
        if let Rhythm::Period { job, .. } = &mut own.kind {
            *job = Some(ready);
        }
        self.send(client, &line);
    }

    fn text(&self, ty: TypeId, bytes: &[u8]) -> String {
        format_value(&self.about.program.types, ty, bytes)
    }

    /// Lines of the journal for what was done.
    fn audit(&self, event: Event, targets: &[Target], items: &[Item], who: &Who, time: takt_abi::Time) {
        let entry = || Entry::new(event).at(time).by(&who.name, &who.from, &who.reason);
        for (index, item) in items.iter().enumerate() {
            match (&item.command, targets.get(index)) {
                (Command::ReleaseAll { restore }, _) => {
                    self.post(entry().variable("all").message(if *restore { "restored" } else { "kept" }));
                }
                (Command::Reset(kind), _) => self.post(entry().message(format!("{kind:?}").to_lowercase())),
                (Command::ResetTask(task), _) => {
                    let name = self.about.program.tasks.get(*task as usize).map_or("?", |task| &task.name);
                    self.post(entry().message(format!("task {name}")));
                }
                (Command::Halt, _) => self.post(entry().message("halt")),
                (_, Some(target)) => {
                    let [old, new] = [&item.old, &item.new].map(|bytes| Some(self.text(target.place.ty, bytes)));
                    self.post(entry().variable(&target.name).values(old, new));
                }
                _ => {}
            }
        }
    }

    /// Remembers who forced what.
    fn keep(&mut self, targets: &[Target], items: &[Item], who: &Who) {
        for (index, item) in items.iter().enumerate() {
            let target = targets.get(index);
            match (&item.command, target) {
                (Command::Force { place, .. }, Some(target)) => {
                    let note = Note { name: target.name.clone(), who: who.clone(), since: SystemTime::now() };
                    self.notes.insert((place.offset, place.ty.0), note);
                }
                (Command::Release { place, .. }, _) => {
                    self.notes.remove(&(place.offset, place.ty.0));
                    self.holds.forget(*place);
                }
                (Command::ReleaseAll { .. }, _) => {
                    self.notes.clear();
                    self.holds.forget_forces();
                }
                _ => {}
            }
        }
    }

    /// Begins or renews leases; a client that has gone meanwhile holds nothing.
    fn hold(&mut self, client: u64, event: Event, targets: &[Target], items: &[Item], lease: Duration) {
        for (target, item) in targets.iter().zip(items) {
            let way = if event == Event::Force { Way::Force } else { Way::Write(item.old.clone()) };
            let hold = Hold { client, name: target.name.clone(), place: target.place, way, lease, until: Instant::now() + lease };
            if self.sessions.get(&client).is_some_and(|session| !session.ended && session.armed.is_some()) {
                self.holds.add(hold);
            } else {
                self.let_go(&hold, "its client has gone");
            }
        }
    }

    fn status(&self, status: &Status) -> Value {
        json!({
            "state": if status.fault.is_some() { "faulted" } else { answer::mode(status.mode) },
            "mode": answer::mode(status.mode),
            "fault": answer::fault(status),
            "tasks": answer::tasks(&self.about.program, status),
            "bus": { "fault": status.io_fault.map(|fault| fault.to_string()), "faults": status.io_faults },
            "at_rest": status.at_rest,
            "forces": self.forces(status),
            "clients": self.sessions.len(),
            "journal": !self.journal_failing(),
        })
    }

    fn forces(&self, status: &Status) -> Value {
        let mut rest = &status.bytes[..];
        let force = |place: &Place| {
            let size = self.about.program.types.size(place.ty) as usize;
            let (value, behind) = rest.split_at_checked(size)?;
            let (before, behind) = behind.split_at_checked(size)?;
            rest = behind;
            let note = self.notes.get(&(place.offset, place.ty.0));
            let mut line = json!({
                "variable": note.map_or_else(|| format!("offset {}", place.offset), |note| note.name.clone()),
                "value": crate::values::to_json(&self.about.program.types, place.ty, value),
                "before": crate::values::to_json(&self.about.program.types, place.ty, before),
            });
            if let Some(note) = note {
                line["by"] = note.who.name.clone().into();
                line["reason"] = note.who.reason.clone().into();
                line["since"] = humantime::format_rfc3339_millis(note.since).to_string().into();
            }
            if let Some(left) = self.holds.left(*place, Instant::now()) {
                line["lease_ms"] = (left.as_millis() as u64).into();
            }
            Some(line)
        };
        Value::Array(status.forces.iter().map_while(force).collect())
    }
}

fn out_of_period(what: &str, time: u64) -> Problem {
    let range = limits::PERIOD_MS;
    Problem::new("out-of-range", format!("a {what} of {time} ms")).expected(format!("{} to {}", range.start(), range.end()))
}
