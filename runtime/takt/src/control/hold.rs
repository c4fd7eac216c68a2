//! What clients hold: forces, and values on a lease. Time is an argument.

use super::limits;
use std::time::{Duration, Instant};
use takt_engine::Command;
use takt_ir::Place;

/// How a variable is held.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Way {
    /// By a force.
    Force,
    /// It was written, and this goes back.
    Write(Box<[u8]>),
}

/// A variable that a client holds until it lets go, vanishes, or its lease runs out.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Hold {
    pub client: u64,
    pub name: String,
    pub place: Place,
    pub way: Way,
    pub lease: Duration,
    pub until: Instant,
}

impl Hold {
    /// What ends it.
    pub fn end(&self) -> Command {
        match &self.way {
            Way::Force => Command::Release { place: self.place, restore: true },
            Way::Write(old) => Command::Write { place: self.place, bytes: old.clone() },
        }
    }
}

/// All of them.
#[derive(Debug, Default)]
pub(super) struct Holds(Vec<Hold>);

impl Holds {
    /// Whether another client holds a place.
    pub fn by_other(&self, client: u64, place: Place) -> bool {
        self.0.iter().any(|hold| hold.place == place && hold.client != client)
    }
    /// Whether there is room for so many more.
    pub fn room_for(&self, more: usize) -> bool {
        self.0.len() + more <= limits::HOLDS
    }
    /// Begins or renews a hold. What the variable was before the first one stays what goes back.
    pub fn add(&mut self, hold: Hold) {
        match self.0.iter_mut().find(|old| old.place == hold.place && old.client == hold.client) {
            Some(old) => {
                (old.lease, old.until) = (hold.lease, hold.until);
                if hold.way == Way::Force {
                    old.way = Way::Force;
                }
            }
            None => self.0.push(hold),
        }
    }
    /// A client says that it is still there; how many it holds.
    pub fn renew(&mut self, client: u64, now: Instant) -> usize {
        let own = self.0.iter_mut().filter(|hold| hold.client == client);
        own.map(|hold| hold.until = now + hold.lease).count()
    }
    /// Forgets a place: it was released or written for good.
    pub fn forget(&mut self, place: Place) {
        self.0.retain(|hold| hold.place != place);
    }
    /// Forgets all forces.
    pub fn forget_forces(&mut self) {
        self.0.retain(|hold| hold.way != Way::Force);
    }
    /// Takes out what has run out.
    pub fn expired(&mut self, now: Instant) -> Vec<Hold> {
        self.take(|hold| hold.until <= now)
    }
    /// Takes out what a client holds.
    pub fn of_client(&mut self, client: u64) -> Vec<Hold> {
        self.take(|hold| hold.client == client)
    }
    /// When the next one runs out.
    pub fn next(&self) -> Option<Instant> {
        self.0.iter().map(|hold| hold.until).min()
    }
    /// How long a place is still held on a lease.
    pub fn left(&self, place: Place, now: Instant) -> Option<Duration> {
        self.0.iter().find(|hold| hold.place == place).map(|hold| hold.until.saturating_duration_since(now))
    }
    fn take(&mut self, wanted: impl Fn(&Hold) -> bool) -> Vec<Hold> {
        let mut taken = Vec::new();
        self.0.retain(|hold| {
            let wanted = wanted(hold);
            if wanted {
                taken.push(hold.clone());
            }
            !wanted
        });
        // The last one first: of two on the same bytes the older knows what was there.
        taken.reverse();
        taken
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_ir::TypeId;

    fn hold(client: u64, offset: u32, way: Way, now: Instant) -> Hold {
        let lease = Duration::from_millis(500);
        Hold { client, name: String::new(), place: Place { offset, ty: TypeId(0) }, way, lease, until: now + lease }
    }

    #[test]
    fn a_lease_runs_out_unless_it_is_renewed() {
        let (mut holds, start) = (Holds::default(), Instant::now());
        let at = |ms: u64| start + Duration::from_millis(ms);
        holds.add(hold(1, 16, Way::Force, start));
        holds.add(hold(2, 32, Way::Write([7].into()), start));
        assert_eq!((holds.renew(1, at(400)), holds.next()), (1, Some(at(500))));
        let ended = holds.expired(at(500));
        let [jog] = &ended[..] else { panic!("{ended:?}") };
        assert_eq!(jog.end(), Command::Write { place: jog.place, bytes: [7].into() });
        assert!(holds.expired(at(899)).is_empty() && holds.expired(at(900)).len() == 1 && holds.next().is_none());
    }

    #[test]
    fn what_was_before_the_first_hold_goes_back() {
        let (mut holds, now) = (Holds::default(), Instant::now());
        holds.add(hold(1, 16, Way::Write([1].into()), now));
        holds.add(hold(1, 16, Way::Write([2].into()), now));
        assert!(holds.by_other(2, Place { offset: 16, ty: TypeId(0) }));
        let ended = holds.of_client(1);
        assert!(ended.len() == 1 && ended[0].way == Way::Write([1].into()), "{ended:?}");
    }
}
