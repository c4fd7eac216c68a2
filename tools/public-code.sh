#!/usr/bin/env bash
# Checks public ST code with takt: tools/public-code.sh DIR
#
# DIR holds checkouts, each in a folder called as its repository (`git clone URL DIR/NAME`, then `git checkout COMMIT`). What is missing is skipped and said.
# For each repository: how many units (POUs, types, lists of globals, interfaces) it has and how many of them no error touches.
# TAKT names the binary (default: target/debug/takt of this project, else `takt`). The exit code is 1 below 95 % in all.
set -euo pipefail

# name | URL | commit | licence | folder or file (several with commas) | files that are not ours to accept (a regular expression)
readonly REPOSITORIES='
oscat|https://github.com/PLC-lang/oscat|80d46388ba70ce4e89cfae5ffb0f3ab833eeee5a|OSCAT licence|oscat.st,stubs.st|^$
struckig|https://github.com/stefanbesler/struckig|1b49897943be9d6ab8905e8d9b5aea086787411f|MIT (file headers: GPL-3.0)|Struckig|^$
TcUnit|https://github.com/tcunit/TcUnit|05953c5da658cf1ae5f4b47c2d5bd9e767cfa81c|MIT|TcUnit|^$
TwinCat-Dynamic-Collections|https://github.com/fisothemes/TwinCat-Dynamic-Collections|3c4020dc273685bf0ab7c678f78852239a6c4ed9|MIT|src/TwinCat Dynamic Collections/TcDynCollections|^$
TcLog|https://github.com/bengeisler/TcLog|1219e5ef0b483376acff54e8b9faf9e077d56e57|MIT|TcLogProj/TcLog|^$
TwinCAT.OpenFramework|https://github.com/trofimich/TwinCAT.OpenFramework|13b610dcc53a21168823cfdc90607bbed2421bff|MIT|Sources|^$
Procedural_To_SOLID|https://github.com/Beckhoff-USA-Community/Procedural_To_SOLID|075b65dc2a30d8f91ccdd1b18a591b805fd83c16|MIT|NEM2026|^$
TcOpen|https://github.com/TcOpenGroup/TcOpen|60fc21e9b0baa233035e0f10585883f9ea76fdb9|MIT|src|expected\.TcPOU$
HomeAutomation.CoDeSys3|https://github.com/MichielVanwelsenaere/HomeAutomation.CoDeSys3|eed5bad40cf8ad04c8d76de0ca4f56a4bef0b67e|MIT|src/Exports/PLCopen.xml|^$
OOP-IEC61131-3--Curso-Youtube|https://github.com/runtimevic/OOP-IEC61131-3--Curso-Youtube|60fff4c5b41d41411f9f15f70000df705adabf03|no licence file found|TC3_OOP,TC3_Design_Patterns|^$
rusty|https://github.com/PLC-lang/rusty|44b84d619bbda9770daae294809b7353192d81d5|see COPYING|each:tests/lit/single|XFAIL|validat
iec-checker|https://github.com/jubnzv/iec-checker|acf1e79d7bdedce6ff8efa5183873a5e7efe0d29|see COPYING|each:test/st/good|^$
matiec|https://github.com/mengmengjiang1999/matiec|52f3446b588c0c9e38b20517bd974a1efbb830fd|see COPYING|each:tests/cli/profile-fixtures|(invalid|unknown|private|ambiguous|unresolved|incompatible|duplicate|inout-literal)
controlforge-structured-text|https://github.com/ControlForge-Systems/controlforge-structured-text|d74badcb806d206cd0d064c7aefbeca54d5fb3ef|MIT|each:manual-tests/syntax|^$
lcls-twincat-motion|https://github.com/pcdshub/lcls-twincat-motion|29bbc3c93134a3b4ac801290f8fea880a886f066|no licence file found|lcls-twincat-motion/Library|Deprecated
'

# A library has no program to run; that is no mistake of its units.
readonly HARMLESS='E0401'

die() {
    echo "public-code: $*" >&2
    exit 2
}

# The files of ST below the folders that are named.
sources() {
    find "$@" -type f \( -iname '*.st' -o -iname '*.TcPOU' -o -iname '*.TcDUT' -o -iname '*.TcGVL' -o -iname '*.TcIO' -o -iname '*.xml' \) -print0 | sort -z
}

# file:line of each unit. A file of TwinCAT is one unit.
units() {
    local file
    while IFS= read -r -d '' file; do
        case ${file,,} in
            *.st) awk -v file="$file" 'BEGIN { IGNORECASE = 1 } { line = toupper($0) }
                line ~ /^[ \t]*(FUNCTION|FUNCTION_BLOCK|PROGRAM|INTERFACE|TYPE|CONFIGURATION|VAR_GLOBAL)([^A-Z0-9_]|$)/ { print file "\t" FNR }' "$file" ;;
            *.xml) awk -v file="$file" '/<(pou|dataType|globalVars|interface|data) [^>]*name="/ && !/<data [^>]*(method|property|attributes|buildproperties|objectid)"/ { print file "\t" FNR }' "$file" ;;
            *) printf '%s\t1\n' "$file" ;;
        esac
    done
}

# Errors as file, line, code; what takt says of no file goes to standard error.
errors() {
    local output status=0
    output=$("$takt" check --format json "$@" 2>>"$log") || status=$?
    if ((status > 1)) && [[ -z $output ]]; then
        printf '%s\t0\tUNREADABLE\n' "$1"
        return
    fi
    jq -r --arg harmless "$HARMLESS" 'select(.severity == "error" and .code != $harmless) | [.file, .line, .code] | @tsv' <<<"$output"
}

# All errors of a place: per project of TwinCAT, per file with `each:`, else of all files together.
check_places() {
    local each=$1 place project file
    shift
    if [[ $each == yes ]]; then
        while IFS= read -r -d '' file; do errors "$file"; done < <(sources "$@")
        return
    fi
    local -a rest=()
    for place in "$@"; do
        local -a projects=()
        mapfile -d '' projects < <(find "$place" -type f -iname '*.plcproj' -print0 | sort -z)
        if ((${#projects[@]} == 0)); then
            rest+=("$place")
        fi
        for project in "${projects[@]}"; do errors "$(dirname "$project")"; done
    done
    if ((${#rest[@]} > 0)); then errors "${rest[@]}"; fi
}

# Units, and units without an error: an error belongs to the last unit that begins at or before its line.
count() {
    awk -F '\t' '
        NR == FNR { total++; n[$1]++; start[$1, n[$1]] = $2; next }
        { file = $1; unit = 0
          for (i = 1; i <= n[file]; i++) if (start[file, i] <= $2) unit = i
          if (unit == 0 && n[file] > 0) unit = 1
          if (unit == 0) { foreign++; next }
          if (!((file, unit) in bad)) { bad[file, unit] = 1; wrong++ } }
        END { print total + 0, total - wrong }' "$1" "$2"
}

percent() {
    awk -v part="$1" -v all="$2" 'BEGIN { printf "%.1f", all ? 100 * part / all : 0 }'
}

# Checks one repository and prints its line; its counts are added to all_units and all_good.
repository() {
    local name=$1 commit=$2 places=$3 skip=$4 each=no at place good total
    local checkout=$root/$name
    if [[ ! -d $checkout ]]; then
        printf '%-32s not there\n' "$name"
        return
    fi
    at=$(git -C "$checkout" rev-parse HEAD 2>/dev/null || echo none)
    if [[ $at != "$commit" ]]; then
        echo "public-code: warning: $name is at $at, the table says $commit" >&2
    fi
    if [[ $places == each:* ]]; then each=yes places=${places#each:}; fi
    local -a paths=()
    IFS=, read -r -a paths <<<"$places"
    local -a found=()
    for place in "${paths[@]}"; do
        if [[ -e $checkout/$place ]]; then found+=("$checkout/$place"); else echo "public-code: warning: $name has no $place" >&2; fi
    done
    if ((${#found[@]} == 0)); then return; fi
    sources "${found[@]}" | units | { grep -vE "$skip" || true; } >"$work/units"
    check_places "$each" "${found[@]}" | { grep -vE "$skip" || true; } >"$work/errors"
    cp "$work/errors" "$work/$name.errors"
    read -r total good < <(count "$work/units" "$work/errors")
    all_units=$((all_units + total)) all_good=$((all_good + good))
    printf '%-32s %6d units  %6d without error  %5s %%\n' "$name" "$total" "$good" "$(percent "$good" "$total")"
    cut -f 3 "$work/errors" | sort | uniq -c | sort -rn | awk '{ printf "    %s × %s\n", $2, $1 }'
}

main() {
    [[ $# == 1 && -d $1 ]] || die "usage: tools/public-code.sh DIR (a folder of checkouts)"
    command -v jq >/dev/null || die "jq is needed"
    root=$(cd "$1" && pwd)
    local own
    own=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)/target/debug/takt
    takt=${TAKT:-$own}
    [[ -x $takt ]] || takt=$(command -v takt) || die "no takt: build it (cargo build -p takt) or set TAKT"
    work=$(mktemp -d)
    log=$work/log
    trap 'rm -rf "$work"' EXIT
    all_units=0 all_good=0
    local name commit places skip
    while IFS='|' read -r name _ commit _ places skip; do
        if [[ -n $name ]]; then repository "$name" "$commit" "$places" "$skip"; fi
    done <<<"$REPOSITORIES"
    local share
    share=$(percent "$all_good" "$all_units")
    printf '%-32s %6d units  %6d without error  %5s %%\n' total "$all_units" "$all_good" "$share"
    ((all_units > 0)) || die "no checkout was found in $root"
    awk -v share="$share" 'BEGIN { exit !(share >= 95) }'
}

main "$@"
