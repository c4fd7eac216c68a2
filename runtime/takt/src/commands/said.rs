//! What the program says to people (ADSLOGSTR), shown as it is said.
//!
//! In virtual time behind the scan that said it. Under the real clock the resource thread only copies messages into a ring, and another thread shows them.

use super::Exit;
use super::run::usage;
use crate::console;
use crate::language::{self, Language, Word};
use crate::machine::Machine;
use rtrb::{Consumer, Producer, RingBuffer};
use std::thread::JoinHandle;
use std::time::Duration;
use takt_abi::{Message, MessageLevel};

/// How often the thread looks for messages.
const LOOK: Duration = Duration::from_millis(20);
/// Messages that wait for the thread; with those that wait in the engine it is as much as a program says in a burst.
const WAITING: usize = 1024;

/// Shows messages.
pub(super) enum Teller {
    /// Behind each scan.
    Here,
    /// On a thread.
    There(Producer<Message>, JoinHandle<()>),
}

impl Teller {
    /// Starts the thread if the machine runs on the real clock. Call it before the calling thread becomes the resource thread.
    pub(super) fn start(real: bool) -> Result<Self, Exit> {
        if !real {
            return Ok(Self::Here);
        }
        let (sender, receiver) = RingBuffer::new(WAITING);
        let thread = std::thread::Builder::new().name("messages".into()).spawn(move || show(receiver));
        let thread = thread.map_err(|error| usage(&format!("there is no thread for the program's messages: {error}")))?;
        Ok(Self::There(sender, thread))
    }

    /// Behind a scan. What finds no room in the ring waits in the engine.
    pub(super) fn scanned(&mut self, machine: &mut Machine) {
        let engine = machine.engine();
        match self {
            Self::Here => {
                while let Some(message) = engine.take_message() {
                    tell(&message);
                }
                lost(engine.lost_messages());
            }
            Self::There(sender, _) => {
                while sender.slots() > 0
                    && let Some(message) = engine.take_message()
                {
                    // There was a slot, and nobody else fills it.
                    let _ = sender.push(message);
                }
            }
        }
    }

    /// Shows what is left.
    pub(super) fn finish(self, machine: &mut Machine) {
        if let Self::There(sender, thread) = self {
            drop(sender);
            // A thread that has ended early has shown what it could.
            let _ = thread.join();
        }
        Self::Here.scanned(machine);
    }
}

/// The thread: until the sender has gone and everything it sent is shown.
fn show(mut receiver: Consumer<Message>) {
    loop {
        let over = receiver.is_abandoned();
        while let Ok(message) = receiver.pop() {
            tell(&message);
        }
        if over {
            return;
        }
        std::thread::sleep(LOOK);
    }
}

fn tell(message: &Message) {
    console::tell(line(message, language::of_environment()));
}

fn lost(count: u64) {
    if count > 0 {
        let language = language::of_environment();
        console::tell(format_args!("{}: {count} {}", Word::Warning.text(language), Word::MessagesLost.text(language)));
    }
}

/// `    0.010 s  error: text`, without what would move the cursor.
fn line(message: &Message, language: Language) -> String {
    let word = match message.level {
        MessageLevel::Info => Word::Message,
        MessageLevel::Warning => Word::Warning,
        MessageLevel::Error => Word::Error,
    };
    let text: String = message.text.to_text().chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    format!("{:>9.3} s  {}: {text}", message.time.seconds(), word.text(language))
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_abi::{Str, Time};

    #[test]
    fn a_message_is_one_line() {
        let message = Message { time: Time::from_millis(1500), level: MessageLevel::Warning, text: Str::new("a\x1b[2J\nb") };
        assert_eq!(line(&message, Language::English), "    1.500 s  warning: a [2J b");
    }

    #[test]
    fn all_messages_reach_the_thread() {
        let Ok(Teller::There(mut sender, thread)) = Teller::start(true) else { panic!("a thread") };
        let message = Message { time: Time(0), level: MessageLevel::Info, text: Str::EMPTY };
        (0..WAITING).for_each(|_| sender.push(message).expect("room for all"));
        assert!(sender.push(message).is_err() || sender.slots() > 0);
        drop(sender);
        thread.join().expect("it ends");
    }
}
