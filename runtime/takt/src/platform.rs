//! What depends on the operating system: a request to stop, the width of the terminal.

use std::sync::atomic::{AtomicBool, Ordering};

static STOP: AtomicBool = AtomicBool::new(false);

/// Whether Ctrl-C was pressed, or the system asked to end.
pub fn stop_requested() -> bool {
    STOP.load(Ordering::Relaxed)
}

/// From now on Ctrl-C is a request, obeyed between scans; a second one ends the process at once.
#[cfg(unix)]
#[allow(unsafe_code, reason = "the standard library has no signal handlers")]
pub fn listen_for_stop() {
    extern "C" fn request(signal: libc::c_int) {
        if STOP.swap(true, Ordering::Relaxed) {
            // SAFETY: `signal` and `raise` are async-signal-safe (POSIX.1-2017, 2.4.3).
            unsafe {
                libc::signal(signal, libc::SIG_DFL);
                libc::raise(signal);
            }
        }
    }
    for signal in [libc::SIGINT, libc::SIGTERM, libc::SIGHUP] {
        // SAFETY: the handler has the signature that `signal` expects, lives as long as the process and only touches an atomic.
        unsafe {
            libc::signal(signal, request as extern "C" fn(libc::c_int) as libc::sighandler_t);
        }
    }
}

/// Other systems end the process at once.
#[cfg(not(unix))]
pub fn listen_for_stop() {}

/// Columns of the terminal at standard error, if it is one that tells.
#[cfg(unix)]
#[allow(unsafe_code, reason = "the standard library does not ask terminals for their size")]
pub fn columns() -> Option<usize> {
    let mut size = libc::winsize { ws_row: 0, ws_col: 0, ws_xpixel: 0, ws_ypixel: 0 };
    // SAFETY: TIOCGWINSZ writes one `winsize` to the pointer, which is valid for the whole call; a file that is no terminal is refused.
    let result = unsafe { libc::ioctl(libc::STDERR_FILENO, libc::TIOCGWINSZ, &raw mut size) };
    (result == 0 && size.ws_col > 0).then(|| usize::from(size.ws_col))
}

/// Other systems do not tell.
#[cfg(not(unix))]
pub fn columns() -> Option<usize> {
    None
}
