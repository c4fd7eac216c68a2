//! The running program: scans, polls and bus cycles.
//!
//! [`Core`] is what an executor's poll comes back to. A scan of a higher task may run inside a poll of a lower one; everything that belongs to one scan is
//! kept in its [`TaskState`] or saved around the inner scan.

use crate::axis::stage::Stage;
use crate::bus::{IoDriver, IoFault, ProcessImage};
use crate::executor::Executor;
use crate::fault::{FaultRecord, RawFault};
use crate::force::Forces;
use crate::latch::Latches;
use crate::limits::Alarm;
use crate::load::Link;
use crate::mapping::Mapping;
use crate::memory::{Image, Lane, Pinned, execute};
use crate::observe::Observer;
use crate::options::{Clock, Preemption};
use crate::replay::{Recorder, Script};
use crate::retain::{Keeper, Reset, Restore};
use crate::schedule::{Stopped, TaskState};
use crate::system::SystemInfo;
use std::cell::OnceCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use takt_abi::{Context, Env, Fault, Time};
use takt_ir::Program;

/// Fuel after which a poll looks whether it shall stop, at the latest.
const STOP_SLICE: u64 = 1 << 16;
/// Scans in one step at the most, so that an overloaded machine still listens between steps.
const SCANS_IN_A_STEP: u32 = 64;
/// Preemptions that are recorded.
const RECORDED: usize = 1 << 16;

/// Everything a running program needs.
pub(crate) struct Core {
    pub program: Arc<Program>,
    pub executor: Executor,
    pub image: Image,
    pub env: Pinned<Env>,
    pub tasks: Vec<TaskState>,
    /// For initial values and conditions.
    pub spare: Pinned<Lane>,
    pub bus: usize,
    pub stage: Stage,
    pub links: Vec<Link>,
    /// What the program is told of its tasks.
    pub system: SystemInfo,
    /// Variables with addresses from VAR_CONFIG.
    pub mappings: Vec<Mapping>,
    pub io: ProcessImage,
    pub driver: Box<dyn IoDriver>,
    pub io_fault: Option<IoFault>,
    pub io_faults: u64,
    pub forces: Forces,
    /// What tasks see of variables that others write.
    pub latches: Latches,
    /// Takes snapshots of the retained variables.
    pub keeper: Option<Keeper>,
    pub fuel_limit: u64,
    pub depth_limit: u32,
    pub clock: Clock,
    pub alarm: Option<Box<dyn Alarm>>,
    pub observer: Option<Box<dyn Observer>>,
    pub stopwatch: Option<fn() -> u64>,
    /// Sorted by task, scan, fuel (virtual clock).
    pub preempt: Vec<Preemption>,
    /// What happened (real clock).
    pub recorded: Vec<Preemption>,
    pub recorder: Option<Box<dyn Recorder>>,
    /// The recording that is obeyed.
    pub script: Option<Script>,
    pub stop: Arc<AtomicBool>,
    pub fault: Option<RawFault>,
    pub record: OnceCell<FaultRecord>,
    pub now: Time,
    pub steps: u64,
    /// The task whose scan is running.
    pub current: Option<usize>,
    /// Stopwatch and clock time that scans inside the current one took.
    pub inner_ns: u64,
    pub inner_time: Time,
    pub scan_started: Time,
}

impl Core {
    /// Bytes of native stack that a step can use at the most: every task may be interrupted by the next higher one.
    pub fn native_stack(&self) -> usize {
        match &self.executor {
            Executor::Interpreter => takt_jit::NATIVE_STACK * (self.tasks.len() + 1),
            Executor::Jit(code) => code.native_stack_bound(self.depth_limit) * self.tasks.len() + takt_jit::NATIVE_STACK,
        }
    }

    /// Runs what is due at `now`.
    pub fn step(&mut self, now: Time) {
        self.now = now;
        if let Some(recorder) = &mut self.recorder {
            recorder.step(now);
        }
        if self.steps == 0 {
            for task in &mut self.tasks {
                task.release = now;
            }
            self.exchange(now);
        }
        self.steps += 1;
        if self.fault.is_some() {
            return self.step_faulted(now);
        }
        for _ in 0..SCANS_IN_A_STEP.max(self.tasks.len() as u32) {
            let Some((task, now)) = self.pick(now) else { break };
            self.tell_scan(task, now, 0);
            self.release(task, now);
            if self.fault.is_some() || self.stop.load(Ordering::Relaxed) {
                break;
            }
        }
        if self.fault.is_none() && self.tasks[self.bus].step == self.steps {
            self.keep(now);
        }
    }

    /// Takes a snapshot of the retained variables if one is due. No task is in the middle of a scan.
    fn keep(&mut self, now: Time) {
        if let Some(keeper) = &mut self.keeper {
            keeper.at_boundary(now, self.image.bytes());
        }
    }

    /// The bus goes on alone.
    fn step_faulted(&mut self, now: Time) {
        let bus = self.bus;
        if self.tasks[bus].next_release().is_none_or(|r| r <= now) {
            self.tasks[bus].start(now);
            self.bus_inputs();
            self.bus_outputs(now);
        }
    }

    /// The most important task that is due and has not run in this step; under a real clock also one that has become due again while others wait.
    fn pick(&mut self, now: Time) -> Option<(usize, Time)> {
        if self.script.is_some() {
            let told = self.pick_as_told();
            self.watch_events(told.map_or(now, |(_, now)| now));
            return told;
        }
        let now = match self.clock {
            Clock::Virtual => now,
            Clock::Real(clock) => clock().max(now),
        };
        self.watch_events(now);
        let step = self.steps;
        let waiting = |t: &TaskState| t.due(now) && t.step != step;
        if !self.tasks.iter().any(waiting) {
            return None;
        }
        let again = matches!(self.clock, Clock::Real(_));
        let due = self.tasks.iter().enumerate().filter(|(_, t)| t.due(now) && (again || t.step != step));
        due.min_by_key(|(i, t)| (t.priority, *i)).map(|(i, _)| (i, now))
    }

    fn watch_events(&mut self, now: Time) {
        for task in &mut self.tasks {
            task.watch(self.image.bytes(), now);
        }
    }

    /// One scan of a task, with the bus cycle around it if the task owns the bus.
    fn release(&mut self, index: usize, now: Time) {
        let outer = self.enter(index, now);
        self.latches.enter(index, self.image.bytes_mut());
        if index == self.bus {
            self.bus_inputs();
        }
        if outer.task.is_none() {
            let wait = matches!(self.clock, Clock::Virtual);
            self.env.get_mut().host.latch(wait);
        }
        self.apply_forces();
        if index == self.bus {
            self.map(Mapping::latch);
        }
        if !self.check_overruns(index, now) {
            self.run(index, now);
        }
        self.apply_forces();
        if index == self.bus {
            self.map(Mapping::publish);
        }
        if index == self.bus {
            self.bus_outputs(now);
        }
        self.latches.leave(self.image.bytes_mut());
        self.leave(index, outer);
        self.observe(index, now);
    }

    fn enter(&mut self, index: usize, now: Time) -> Outer {
        let started = self.clock_now();
        let env = self.env.get_mut();
        let outer = Outer {
            task: self.current.replace(index),
            now: env.now,
            period: env.period,
            env_task: env.task,
            cycle: env.cycle,
            inner_ns: std::mem::take(&mut self.inner_ns),
            inner_time: std::mem::take(&mut self.inner_time),
            scan_started: std::mem::replace(&mut self.scan_started, started),
            stopwatch: self.stopwatch.map(|read| read()),
        };
        let task = &mut self.tasks[index];
        if matches!(self.clock, Clock::Real(_)) {
            task.statistics.jitter_ns.add(started.0.saturating_sub(task.release.0).max(0) as u64);
        }
        let overruns = task.statistics.overruns;
        task.start(now);
        (task.running, task.step) = (true, self.steps);
        let late = task.statistics.overruns > overruns;
        self.system.scan(index, now, task.statistics.cycles, late, self.image.bytes_mut());
        (env.now, env.period, env.task, env.cycle) = (now, task.period, index as u32, task.statistics.cycles);
        outer
    }

    fn leave(&mut self, index: usize, outer: Outer) {
        let ended = self.clock_now();
        let now = self.env.get().now;
        self.leave_as_told(index, now);
        let task = &mut self.tasks[index];
        task.running = false;
        let used = task.granted.saturating_sub_signed(task.lane.get().ctx.fuel);
        task.statistics.fuel_max = task.statistics.fuel_max.max(used);
        let mut total_ns = 0;
        if let (Some(read), Some(start)) = (self.stopwatch, outer.stopwatch) {
            total_ns = read().saturating_sub(start);
            task.statistics.scan_ns.add(total_ns.saturating_sub(self.inner_ns));
        }
        let took = ended.0 - self.scan_started.0;
        if matches!(self.clock, Clock::Real(_)) {
            task.ended(ended, Time(took));
            self.check_time(index, Time(took - self.inner_time.0), ended);
        }
        self.inner_ns = outer.inner_ns + total_ns;
        self.inner_time = Time(outer.inner_time.0 + took);
        self.scan_started = outer.scan_started;
        self.current = outer.task;
        let env = self.env.get_mut();
        (env.now, env.period, env.task, env.cycle) = (outer.now, outer.period, outer.env_task, outer.cycle);
    }

    fn clock_now(&self) -> Time {
        match self.clock {
            Clock::Virtual => Time(0),
            Clock::Real(clock) => clock(),
        }
    }

    /// Runs the body of a task; a fault stops the application, or the task if it is isolated.
    fn run(&mut self, index: usize, now: Time) {
        let granted = self.grant(index, 0);
        let task = &mut self.tasks[index];
        task.granted = granted;
        let (start, size) = task.stack;
        task.lane.get_mut().prepare(granted as i64, u64::from(start) + u64::from(size));
        let (entry, executor) = (task.entry, self.executor.clone());
        self.set_alarm(index);
        let fault = execute(self, |core, i| &mut core.tasks[i].lane, index, &executor, entry, start.into());
        self.clear_alarm();
        if let Some(fault) = fault {
            let task = &self.tasks[index];
            let raw = RawFault::of(&task.lane.get().ctx, fault, Some(index), now, task.statistics.cycles);
            self.stop_application(raw);
        }
    }

    /// Stops the task if it is isolated and the fault is its own, else the application. The first fault counts.
    pub fn stop_application(&mut self, raw: RawFault) {
        if self.fault.is_some() {
            return;
        }
        let own = raw.task.filter(|task| *task != self.bus && raw.fault != Fault::Stopped);
        match own.and_then(|task| self.tasks.get_mut(task)).filter(|task| task.isolated) {
            Some(task) => {
                task.stopped.get_or_insert(Stopped { raw, record: OnceCell::new() });
            }
            None => {
                self.fault = Some(raw);
                self.record = OnceCell::new();
            }
        }
    }

    /// Fuel that the scan may have consumed before the next poll must come back here: so much that it happens exactly at the number that is asked for.
    fn grant(&mut self, index: usize, consumed: u64) -> u64 {
        let mut until = self.fuel_limit_of(index);
        match self.clock {
            Clock::Real(_) => until = until.min(consumed.saturating_add(self.slice())),
            Clock::Virtual => {
                until = until.min(consumed.saturating_add(STOP_SLICE));
                let told = if self.script.is_some() { self.next_told() } else { self.next_preemption(index).map(|next| next.at_fuel) };
                if let Some(at) = told {
                    until = until.min(at.saturating_sub(1).max(consumed));
                }
            }
        }
        until.min(i64::MAX as u64)
    }

    /// The next entry of the list for the scan that the task is in; entries of earlier scans are passed over.
    fn next_preemption(&mut self, index: usize) -> Option<Preemption> {
        let task = &mut self.tasks[index];
        let cycle = task.statistics.cycles;
        while let Some(p) = self.preempt.get(task.next_preemption) {
            if p.task == index && p.cycle >= cycle {
                return (p.cycle == cycle).then_some(*p);
            }
            if p.task > index {
                return None;
            }
            task.next_preemption += 1;
        }
        None
    }

    /// A poll: stop, watchdog, preemption, or a new slice.
    pub fn at_poll(&mut self, ctx: &mut Context) -> Option<Fault> {
        let Some(index) = self.current else {
            return Some(Fault::Watchdog);
        };
        let consumed = self.tasks[index].granted.saturating_add_signed(ctx.fuel.saturating_neg());
        if self.script.is_some()
            && let Some(fault) = self.poll_as_told(index, consumed)
        {
            return Some(fault);
        }
        if consumed > self.fuel_limit_of(index) {
            return self.tell_cut(consumed, Fault::Watchdog);
        }
        if self.stop.load(Ordering::Relaxed) {
            return self.tell_cut(consumed, Fault::Stopped);
        }
        match self.clock {
            Clock::Virtual if self.script.is_some() => {}
            Clock::Virtual => self.preempt_as_told(index, consumed),
            Clock::Real(clock) => {
                Self::hear_alarm(ctx);
                if self.too_long(index, clock()) {
                    return self.tell_cut(consumed, Fault::Watchdog);
                }
                self.preempt_if_due(index, consumed, clock);
                self.set_alarm(index);
            }
        }
        if self.fault.is_some() {
            return Some(Fault::Stopped);
        }
        let granted = self.grant(index, consumed);
        self.tasks[index].granted = granted;
        ctx.fuel = (granted - consumed) as i64;
        None
    }

    fn preempt_as_told(&mut self, index: usize, consumed: u64) {
        while self.fault.is_none() && self.next_preemption(index).is_some_and(|p| p.at_fuel <= consumed) {
            self.tasks[index].next_preemption += 1;
            self.watch_events(self.now);
            let priority = self.tasks[index].priority;
            let higher = self.tasks.iter().enumerate().filter(|(_, t)| t.priority < priority && !t.running);
            let next = higher.filter_map(|(i, t)| Some((t.next_release()?, t.priority, i))).min();
            if let Some((release, _, i)) = next {
                self.interrupt(index, i, release.max(self.now), consumed);
            }
        }
    }

    fn preempt_if_due(&mut self, index: usize, consumed: u64, clock: fn() -> Time) {
        let priority = self.tasks[index].priority;
        let now = clock();
        let due = |t: &TaskState| t.priority < priority && t.due(now);
        while self.fault.is_none() {
            self.watch_events(now);
            let next = self.tasks.iter().enumerate().filter(|(_, t)| due(t)).min_by_key(|(i, t)| (t.priority, *i));
            let Some((i, _)) = next else { return };
            if self.recorded.len() < RECORDED {
                self.recorded.push(Preemption { cycle: self.tasks[index].statistics.cycles, task: index, at_fuel: consumed });
            }
            self.interrupt(index, i, now, consumed);
        }
    }

    /// A scan of task `by` inside the one of `index`.
    pub fn interrupt(&mut self, index: usize, by: usize, now: Time, consumed: u64) {
        self.tasks[index].statistics.preempted += 1;
        self.now = self.now.max(now);
        self.tell_scan(by, now, consumed);
        self.release(by, now);
    }

    fn bus_inputs(&mut self) {
        let image = self.image.bytes_mut();
        for link in &self.links {
            link.latch(image, &self.io);
        }
        let cycle = self.tasks[self.bus].statistics.cycles;
        self.stage.inputs(image, &self.io, cycle);
    }

    fn bus_outputs(&mut self, now: Time) {
        let faulted = self.fault.is_some();
        let image = self.image.bytes_mut();
        self.stage.outputs(image, &mut self.io, faulted);
        for link in &self.links {
            link.publish(image, &mut self.io, faulted);
        }
        self.exchange(now);
    }

    fn exchange(&mut self, now: Time) {
        let result = catch_unwind(AssertUnwindSafe(|| self.driver.exchange(now, &mut self.io)));
        self.io_fault = result.unwrap_or(Err(IoFault::Panic)).err();
        self.io_faults += u64::from(self.io_fault.is_some());
        if let Some(recorder) = &mut self.recorder {
            recorder.exchange(self.io_fault.map_or(Ok(()), Err), &self.io);
        }
        self.stage.bus_answered(self.io_fault.is_none());
    }

    /// Copies between variables and their addresses, against which forces hold too.
    fn map(&mut self, copy: fn(&mut Mapping, &mut [u8])) {
        if self.mappings.is_empty() {
            return;
        }
        let image = self.image.bytes_mut();
        self.mappings.iter_mut().for_each(|mapping| copy(mapping, image));
        self.apply_forces();
    }

    /// Holds forced variables at their values.
    pub fn apply_forces(&mut self) {
        self.forces.apply(self.image.bytes_mut());
    }

    /// Puts the program at its start: initial bytes, retained values, resources, initial values, axes.
    ///
    /// Retained values stand there before FB_Init runs, as in CODESYS. Where some are missing, the program is initialised without any first, so that what
    /// is missing gets its initial value even if that is computed.
    pub fn initialise(&mut self, restore: Option<&Restore>) -> Result<(), Box<FaultRecord>> {
        let mut all = None;
        if let Some(restore) = restore.filter(|r| !r.complete && self.program.init_body.is_some()) {
            self.start(None)?;
            restore.apply(self.image.bytes_mut());
            all = Some(Restore::of_image(&self.program, restore.kind, self.image.bytes()));
        }
        self.start(all.as_ref().or(restore))?;
        self.stage.attach(self.image.bytes_mut());
        let now = self.now;
        for task in &mut self.tasks {
            task.pending = false;
            task.watch(self.image.bytes(), now);
            task.pending = false;
        }
        Ok(())
    }

    /// The bytes that the switch of the start code has while it runs.
    fn set_switch(&mut self, kind: Option<Reset>) {
        let at = self.program.restart as usize;
        let value = match kind {
            None | Some(Reset::Origin) => 0,
            Some(Reset::Warm) => 1,
            Some(Reset::Cold) => 2,
        };
        if at != 0 {
            self.image.bytes_mut()[at..at + takt_ir::retain::RESTART_BYTES as usize].copy_from_slice(&[value, 0]);
        }
    }

    fn start(&mut self, restore: Option<&Restore>) -> Result<(), Box<FaultRecord>> {
        let program = self.program.clone();
        let image = self.image.bytes_mut();
        image.fill(0);
        image[..program.init.len()].copy_from_slice(&program.init);
        self.system.start(&program, image);
        if let Some(restore) = restore {
            restore.apply(image);
        }
        self.set_switch(restore.map(|r| r.kind));
        let resources = self.new_resources();
        let (now, period) = (self.now, self.tasks[self.bus].period);
        let env = self.env.get_mut();
        env.resources = resources;
        env.heap = program.heap();
        if !program.classes.is_empty() {
            env.classes.put(0, 0, takt_abi::GRANULE, u64::from(program.image_size) / takt_abi::GRANULE);
            program.instances.iter().for_each(|run| {
                let stride = program.class(run.class).map_or(takt_abi::GRANULE, |class| class.size.into());
                env.classes.put(run.offset.into(), run.class, stride, run.count.into());
            });
        }
        (env.now, env.period, env.task, env.cycle) = (now, period, self.bus as u32, 0);
        if let Some(body) = program.init_body {
            let (start, size) = self.tasks[self.bus].stack;
            self.spare.get_mut().prepare(self.fuel_limit.min(i64::MAX as u64) as i64, u64::from(start) + u64::from(size));
            let executor = self.executor.clone();
            if let Some(fault) = execute(self, |core, _| &mut core.spare, 0, &executor, body, start.into()) {
                let raw = RawFault::of(&self.spare.get().ctx, fault, None, now, 0);
                return Err(Box::new(raw.record(&program)));
            }
        }
        self.set_switch(None);
        Ok(())
    }
}

/// What is saved of an interrupted scan.
struct Outer {
    task: Option<usize>,
    now: Time,
    period: Time,
    env_task: u32,
    cycle: u64,
    inner_ns: u64,
    inner_time: Time,
    scan_started: Time,
    stopwatch: Option<u64>,
}
