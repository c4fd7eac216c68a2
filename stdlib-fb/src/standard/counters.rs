//! Counters of IEC 61131-3 for the integers that CTU, CTD and CTUD do not count in: CTU_DINT and its like.

use takt_abi::{BlockDesc, Bool, function_block};

/// All of them.
pub const BLOCKS: &[&BlockDesc] = &[
    CtuInt::DESC,
    CtdInt::DESC,
    CtudInt::DESC,
    CtuDint::DESC,
    CtdDint::DESC,
    CtudDint::DESC,
    CtuLint::DESC,
    CtdLint::DESC,
    CtudLint::DESC,
    CtuUdint::DESC,
    CtdUdint::DESC,
    CtudUdint::DESC,
    CtuUlint::DESC,
    CtdUlint::DESC,
    CtudUlint::DESC,
];

macro_rules! counters {
    ($type:ty: $up:ident $Up:ident, $down:ident $Down:ident, $both:ident $Both:ident) => {
        function_block! {
            /// Up counter (IEC 61131-3, table 45). Each rise of CU adds one to CV, up to the largest value; R sets it to 0 and wins.
            pub block $up as $Up {
                input {
                    /// Counts on its rise.
                    CU: Bool,
                    /// CV := 0.
                    R: Bool,
                    /// Limit.
                    PV: $type
                }
                output {
                    /// CV >= PV.
                    Q: Bool,
                    /// Count.
                    CV: $type
                }
                state { last: Bool }
            }
            fn cycle(fb, _cx) {
                if fb.R.get() {
                    fb.CV = 0;
                } else if fb.CU.get() && !fb.last.get() {
                    fb.CV = fb.CV.saturating_add(1);
                }
                fb.last = fb.CU;
                fb.Q = (fb.CV >= fb.PV).into();
                Ok(())
            }
        }
        function_block! {
            /// Down counter (IEC 61131-3, table 45). Each rise of CD takes one from CV, down to the least value; LD sets it to PV and wins.
            pub block $down as $Down {
                input {
                    /// Counts on its rise.
                    CD: Bool,
                    /// CV := PV.
                    LD: Bool,
                    /// Start value.
                    PV: $type
                }
                output {
                    /// CV <= 0.
                    Q: Bool,
                    /// Count.
                    CV: $type
                }
                state { last: Bool }
            }
            fn cycle(fb, _cx) {
                if fb.LD.get() {
                    fb.CV = fb.PV;
                } else if fb.CD.get() && !fb.last.get() {
                    fb.CV = fb.CV.saturating_sub(1);
                }
                fb.last = fb.CD;
                fb.Q = (fb.CV <= 0).into();
                Ok(())
            }
        }
        function_block! {
            /// Up and down counter (IEC 61131-3, table 45). R wins over LD, and both over counting; rises of CU and CD in one call cancel out.
            pub block $both as $Both {
                input {
                    /// Counts up on its rise.
                    CU: Bool,
                    /// Counts down on its rise.
                    CD: Bool,
                    /// CV := 0.
                    R: Bool,
                    /// CV := PV.
                    LD: Bool,
                    /// Limit and load value.
                    PV: $type
                }
                output {
                    /// CV >= PV.
                    QU: Bool,
                    /// CV <= 0.
                    QD: Bool,
                    /// Count.
                    CV: $type
                }
                state {
                    last_up: Bool,
                    last_down: Bool
                }
            }
            fn cycle(fb, _cx) {
                let up = fb.CU.get() && !fb.last_up.get();
                let down = fb.CD.get() && !fb.last_down.get();
                fb.CV = match (fb.R.get(), fb.LD.get(), up, down) {
                    (true, ..) => 0,
                    (_, true, ..) => fb.PV,
                    (_, _, true, false) => fb.CV.saturating_add(1),
                    (_, _, false, true) => fb.CV.saturating_sub(1),
                    _ => fb.CV,
                };
                (fb.last_up, fb.last_down) = (fb.CU, fb.CD);
                (fb.QU, fb.QD) = ((fb.CV >= fb.PV).into(), (fb.CV <= 0).into());
                Ok(())
            }
        }
    };
}

counters!(i16: CTU_INT CtuInt, CTD_INT CtdInt, CTUD_INT CtudInt);
counters!(i32: CTU_DINT CtuDint, CTD_DINT CtdDint, CTUD_DINT CtudDint);
counters!(i64: CTU_LINT CtuLint, CTD_LINT CtdLint, CTUD_LINT CtudLint);
counters!(u32: CTU_UDINT CtuUdint, CTD_UDINT CtdUdint, CTUD_UDINT CtudUdint);
counters!(u64: CTU_ULINT CtuUlint, CTD_ULINT CtdUlint, CTUD_ULINT CtudUlint);
