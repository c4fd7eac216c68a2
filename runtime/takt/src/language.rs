//! The tool's own words, in English and Chinese.
//!
//! The language follows `LC_ALL`, `LC_MESSAGES` and `LANG`, in this order. Messages of the compiler and the manifest are English.

/// A language of the tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Language {
    /// English.
    #[default]
    English,
    /// 中文.
    Chinese,
}

/// The language of the environment.
pub fn of_environment() -> Language {
    let set = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    of_locale(&set("LC_ALL").or_else(|| set("LC_MESSAGES")).or_else(|| set("LANG")).unwrap_or_default())
}

/// The language of a locale like `zh_CN.UTF-8`.
pub fn of_locale(locale: &str) -> Language {
    if locale.starts_with("zh") { Language::Chinese } else { Language::English }
}

macro_rules! words {
    ($($name:ident $english:literal $chinese:literal,)*) => {
        /// What the tool says of itself.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Word { $(#[doc = $english] $name,)* }
        impl Word {
            /// The text.
            pub fn text(self, language: Language) -> &'static str {
                match (self, language) {
                    $((Self::$name, Language::English) => $english, (Self::$name, Language::Chinese) => $chinese,)*
                }
            }
        }
    };
}
words! {
    Error "error" "错误",
    Warning "warning" "警告",
    Errors "errors" "个错误",
    Warnings "warnings" "个警告",
    NoFindings "no findings" "没有发现问题",
    MoreFindings "more are not shown; correct these first, or ask for --format json" "个未显示;请先改正以上问题,或使用 --format json",
    Help "help" "帮助",
    Cycles "Scans" "扫描周期",
    MachineTime "Machine time" "机器时间",
    ScanTime "Scan time" "扫描时间",
    RealTimeFactor "times real time" "倍实时",
    Overruns "Overruns" "超时",
    Fault "Fault" "故障",
    NoFault "none" "无",
    Demonstration "A demonstration: as fast as possible. Watch it in real time with `--speed real`." "演示:以最快速度运行。用 `--speed real` 可实时观看。",
    Stopped "Stopped on request." "已按请求停止。",
    TimedOut "The demonstration did not end in its time" "演示未在规定时间内结束",
    WaitingFor "it waited for" "正在等待",
    ReadAs "was read as" "读取编码为",
    Message "message" "消息",
    MessagesLost "messages of the program were lost: too many in one scan" "条程序消息丢失:一个周期内过多",
    FilesWritten "files written to" "个文件已写入",
    LeftBehind "Not carried over" "未能导入",
    AlreadyThere "already exists; an import never overwrites" "已存在;导入不会覆盖",
    PlotWritten "Plot" "曲线图",
    TraceWritten "Trace" "记录",
    SamplesLost "samples were lost on the way to trace, plot and live line: the computer was too busy to write them" "个采样在写入记录、曲线图和状态行之前丢失:计算机过于繁忙",
    NotRealTime "the program runs, but not in real time as it should" "程序已运行,但未达到应有的实时条件",
    NoPriority "no real-time priority (CAP_SYS_NICE, or a limit `rtprio`): other programs will delay scans" "没有实时优先级(CAP_SYS_NICE 或 `rtprio` 限制):其他程序会延迟扫描",
    NoLockedMemory "memory cannot be locked (CAP_IPC_LOCK, or a limit `memlock`): pages may have to be fetched during a scan" "内存无法锁定(CAP_IPC_LOCK 或 `memlock` 限制):扫描期间可能需要换页",
    NoWakefulness "/dev/cpu_dma_latency cannot be opened (write permission): a processor that sleeps deeply wakes late" "/dev/cpu_dma_latency 无法打开(写权限):深度休眠的处理器唤醒较晚",
    NoAffinity "the processor that `cpu` in [realtime] names cannot be used" "[realtime] 中 `cpu` 指定的处理器不可用",
    HowToGrant "Grant it with `sudo setcap cap_sys_nice,cap_ipc_lock+ep` on the program `takt`, with `rtprio` and `memlock` in /etc/security/limits.conf, or with `takt service install`. `takt doctor` tells more." "授权方法:对程序 `takt` 执行 `sudo setcap cap_sys_nice,cap_ipc_lock+ep`,或在 /etc/security/limits.conf 中设置 `rtprio` 和 `memlock`,或使用 `takt service install`。`takt doctor` 会给出详细说明。",
    Tasks "Tasks" "任务",
    Scans "scans" "次数",
    Execution "execution µs: last, mean, min, max" "执行时间 µs:最近、平均、最小、最大",
    Jitter "jitter µs: p50, p99, max" "抖动 µs:p50、p99、最大",
    MissedReleases "overruns" "超时",
    Interrupted "interrupted" "被中断",
    StatisticsWritten "Statistics" "统计",
    Running "running" "运行",
    WaitsForReset "The machine waits: `takt ctl reset` starts the program anew, Ctrl-C ends the run." "机器等待中:`takt ctl reset` 重新启动程序,Ctrl-C 结束运行。",
    ReasonNeeded "who changes a machine says why: --reason TEXT (and --as NAME); it goes into the journal" "更改机器须说明原因:--reason TEXT(以及 --as NAME);会写入日志",
    HeldUntil "Held until this command ends (Ctrl-C)." "保持到本命令结束(Ctrl-C)。",
    Done "done" "完成",
    Forced "forced" "个变量被强制",
    NothingForced "nothing is forced" "没有强制变量",
    JournalFails "  the journal cannot be written" "  日志无法写入",
    NoJournal "A machine writes it while it runs in real time: `takt run PATH --speed real`, or with --state DIR." "机器以实时方式运行时写入:`takt run PATH --speed real`,或使用 --state DIR。",
    DefectOfTakt "This is a defect of Takt. Please report it with the program that shows it." "这是 Takt 的缺陷,请附上程序报告。",
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_locale_decides() {
        assert_eq!(of_locale("zh_CN.UTF-8"), Language::Chinese);
        assert_eq!(of_locale("de_DE.UTF-8"), Language::English);
        assert_eq!(of_locale(""), Language::English);
        assert_eq!(Word::Fault.text(Language::Chinese), "故障");
    }
}
