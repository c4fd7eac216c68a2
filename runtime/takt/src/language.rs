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
        #[allow(rustdoc::broken_intra_doc_links, reason = "sections of the manifest in brackets are no links")]
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
    TaskStopped "a fault has stopped a task alone" "故障使一个任务单独停止",
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
    TopicKernel "Kernel" "内核",
    TopicPriority "Real-time priority" "实时优先级",
    TopicMemory "Locked memory" "锁定内存",
    TopicThrottling "Time for real-time threads" "实时线程可用时间",
    TopicGovernor "Processor frequency" "处理器频率",
    TopicIsolation "Isolated processors" "隔离的处理器",
    TopicClock "Clock source" "时钟源",
    TopicSleep "Deepest sleep state wakes after" "最深休眠状态唤醒时间",
    TopicThreads "Hyper-threading" "超线程",
    TopicSwap "Swap" "交换分区",
    TopicVirtual "Virtual machine" "虚拟机",
    TopicNetwork "Network card" "网卡",
    TopicDisk "State folder" "状态文件夹",
    TopicProcessor "Processor of the program" "程序所用的处理器",
    HelpUnknown "could not be read; nothing is known about it" "无法读取,情况未知",
    HelpKernel "no PREEMPT_RT: the kernel may hold a scan up for milliseconds. Debian: `apt install linux-image-rt-amd64`; Ubuntu: `pro enable realtime-kernel`" "没有 PREEMPT_RT:内核可能使扫描延迟数毫秒。Debian:`apt install linux-image-rt-amd64`;Ubuntu:`pro enable realtime-kernel`",
    HelpPriority "other programs will delay scans. `sudo setcap cap_sys_nice,cap_ipc_lock+ep` on the program `takt`, or a line `USER - rtprio 90` in /etc/security/limits.conf and a new login, or `takt service install`" "其他程序会延迟扫描。对程序 `takt` 执行 `sudo setcap cap_sys_nice,cap_ipc_lock+ep`;或在 /etc/security/limits.conf 中加入 `USER - rtprio 90` 并重新登录;或使用 `takt service install`",
    HelpMemory "pages may have to be fetched during a scan. `sudo setcap cap_sys_nice,cap_ipc_lock+ep` on the program `takt`, or a line `USER - memlock unlimited` in /etc/security/limits.conf and a new login, or `takt service install`" "扫描期间可能需要换页。对程序 `takt` 执行 `sudo setcap cap_sys_nice,cap_ipc_lock+ep`;或在 /etc/security/limits.conf 中加入 `USER - memlock unlimited` 并重新登录;或使用 `takt service install`",
    HelpThrottling "a slow task that computes without pause is stopped for the rest (50 ms each second), and fast tasks with it: `sysctl -w kernel.sched_rt_runtime_us=-1`; from Linux 6.12 on also `echo 0 > /sys/kernel/debug/sched/fair_server/cpuN/runtime`, or an isolated processor" "持续计算的慢速任务每秒会被暂停其余时间(50 ms),快速任务也随之暂停:`sysctl -w kernel.sched_rt_runtime_us=-1`;Linux 6.12 起还需 `echo 0 > /sys/kernel/debug/sched/fair_server/cpuN/runtime`,或使用隔离的处理器",
    HelpSwap "memory of other programs may move to the disk, which keeps the computer busy: `sudo swapoff -a`, and remove it from /etc/fstab" "其他程序的内存可能被换到磁盘,使计算机繁忙:`sudo swapoff -a`,并从 /etc/fstab 中删除",
    HelpGovernor "a processor that changes its frequency takes longer for some scans: `sudo cpupower frequency-set -g performance`" "改变频率的处理器会使部分扫描变慢:`sudo cpupower frequency-set -g performance`",
    HelpIsolation "every processor runs other programs too. Kernel options `isolcpus=N nohz_full=N rcu_nocbs=N`, then `cpu = N` under [realtime] in takt.toml" "所有处理器都运行其他程序。使用内核选项 `isolcpus=N nohz_full=N rcu_nocbs=N`,再在 takt.toml 的 [realtime] 中设置 `cpu = N`",
    HelpNohz "the isolated processor still has a timer tick: kernel option `nohz_full=N`" "隔离的处理器仍有定时中断:内核选项 `nohz_full=N`",
    HelpOneProcessor "a single processor is shared by the machine and everything else" "单个处理器由机器程序和其他程序共用",
    HelpClock "reading it is slow; see `dmesg | grep clocksource` for why the processor's own counter is not used" "读取较慢;用 `dmesg | grep clocksource` 查看未使用处理器自身计数器的原因",
    HelpSleep "a processor that sleeps deeply wakes late, and /dev/cpu_dma_latency cannot be written: `takt service install`, or kernel options `processor.max_cstate=1 intel_idle.max_cstate=0`" "深度休眠的处理器唤醒较晚,且 /dev/cpu_dma_latency 无法写入:使用 `takt service install`,或内核选项 `processor.max_cstate=1 intel_idle.max_cstate=0`",
    HelpThreads "two programs share one core and slow each other down: kernel option `nosmt`, or switch it off in the firmware" "两个程序共用一个核心会互相拖慢:内核选项 `nosmt`,或在固件中关闭",
    HelpVirtual "its host may take the processor away for milliseconds: for checking and simulation, not for machines" "宿主机可能占用处理器数毫秒:适合检查和仿真,不适合运行机器",
    HelpNetwork "none was found; EtherCAT needs one of its own" "未找到;EtherCAT 需要专用网卡",
    HelpNetworkVirtual "a card of a virtual machine: not for EtherCAT" "虚拟机网卡:不适用于 EtherCAT",
    HelpNetworkUsb "a card behind USB delays frames: EtherCAT needs one on PCI, such as igb, igc or e1000e" "USB 网卡会延迟帧:EtherCAT 需要 PCI 网卡,如 igb、igc 或 e1000e",
    HelpDiskNotLasting "what is written there is gone after a power cut: retained variables would be lost; name another folder with `--state DIR`" "断电后写入的内容会丢失,保持变量将丢失;请用 `--state DIR` 指定其他文件夹",
    HelpDiskFar "a folder of another computer: retained variables depend on the network; name a local one with `--state DIR`" "位于其他计算机的文件夹:保持变量依赖网络;请用 `--state DIR` 指定本地文件夹",
    HelpDiskTurns "a disk that turns takes tens of milliseconds to write: a power cut loses that much more" "机械硬盘写入需要数十毫秒:断电时会多丢失这段时间的数据",
    HelpNoProcessor "there is no such processor; correct `cpu` under [realtime] in takt.toml" "没有该处理器;请修改 takt.toml 的 [realtime] 中的 `cpu`",
    HelpNotIsolated "other programs run on it too: kernel options `isolcpus=N nohz_full=N rcu_nocbs=N`" "其他程序也在其上运行:内核选项 `isolcpus=N nohz_full=N rcu_nocbs=N`",
    DoctorGood "Nothing is missing." "没有缺失。",
    DoctorMissing "missing" "项缺失",
    DoctorAdvice "could be better" "项可改进",
    NeedsRoot "this needs the rights of root: use `sudo`" "需要 root 权限:请使用 `sudo`",
    ServiceInstalled "The service starts with the computer from now on" "服务将随计算机启动",
    ServiceUninstalled "The service is gone" "服务已移除",
    NotInstalled "not installed" "未安装",
    Running "running" "运行",
    WaitsForReset "The machine waits: `takt ctl reset` starts the program anew, Ctrl-C ends the run." "机器等待中:`takt ctl reset` 重新启动程序,Ctrl-C 结束运行。",
    ReasonNeeded "who changes a machine says why: --reason TEXT (and --as NAME); it goes into the journal" "更改机器须说明原因:--reason TEXT(以及 --as NAME);会写入日志",
    HeldUntil "Held until this command ends (Ctrl-C)." "保持到本命令结束(Ctrl-C)。",
    Done "done" "完成",
    Forced "forced" "个变量被强制",
    NothingForced "nothing is forced" "没有强制变量",
    JournalFails "  the journal cannot be written" "  日志无法写入",
    ExistsForce "exists; write over it with --force" "已存在;使用 --force 覆盖",
    NeedsManifest "is no project with a takt.toml" "不是带有 takt.toml 的项目",
    LeftOut "left out, it is no plain file" "已略过,不是普通文件",
    Files "files" "个文件",
    Bytes "bytes" "字节",
    ForcedVariables "Forced variables" "强制变量",
    Missing "(none)" "(无)",
    NoJournal "A machine writes it while it runs in real time: `takt run PATH --speed real`, or with --state DIR." "机器以实时方式运行时写入:`takt run PATH --speed real`,或使用 --state DIR。",
    CoreTooShort "The recording in the file does not reach the fault; only what was noted when it happened can be shown." "文件中的记录未到达故障点;只能显示故障发生时记下的内容。",
    Locals "locals" "局部变量",
    Members "variables of the instance" "实例变量",
    LastInputs "Last inputs" "最后的输入",
    Replayed "Replayed" "已重放",
    RecordingCut "The recording was not ended: its run was cut off." "记录未正常结束:运行被中断。",
    RecordingWritten "Recording" "输入记录",
    RecordingIncomplete "is incomplete" "不完整",
    CoreWritten "Core file (look at it with `takt core`)" "核心文件(用 `takt core` 查看)",
    NoCore "no core file could be written" "无法写入核心文件",
    RetainTorn "The last write of the retained values was cut off; the generation before it is used" "保持数据的最后一次写入被中断,使用上一代数据",
    RetainAdded "Retained variables without a stored value start with their initial values" "以下保持变量没有存储值,以初始值启动",
    RetainRemoved "Values that the program no longer retains were put aside in" "程序不再保持的值已另存到",
    RetainDropped "Parts of retained variables that are gone were put aside in" "保持变量中已删除的部分已另存到",
    RetainConverted "Retained values were converted to their new types" "以下保持值已转换为新类型",
    RetainFailed "The retained values cannot be written; Takt goes on trying" "无法写入保持数据,将继续尝试",
    RetainNone "no retained values" "没有保持数据",
    RetainImported "values imported" "个值已导入",
    RetainInitial "not in the file, with their initial values" "文件中没有,使用初始值",
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
