#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Starts the guest, runs a command in it, prints what the command prints, and
# exits with its exit status (125: the rig itself failed, 124: time limit).
#
#   run-in-guest.sh [-s suite] [-t seconds] [-i directory] [-o directory] [-p script] [-c] [-v] -- command [args...]
#   run-in-guest.sh [-s suite] -b
#   run-in-guest.sh [-s suite] -w
#
# -i  shared read-only with the guest as /vmrig/in  (default: the current directory)
# -o  shared with the guest as /vmrig/out           (default: a fresh directory, printed)
# -p  run this script on the host beside the guest, with VMRIG_USB (directory of
#     the sockets usb0 to usb3) and VMRIG_OUT set; it is ended with the guest
# -c  cold boot, even where a memory snapshot of the booted guest is in the cache
# -w  only make that snapshot (a run without -c makes it when it is missing)
# -b  boot only: interactive console on this terminal (root, no password; Ctrl-A X ends it)
# -v  the guest's console goes to stderr
#
# Nothing the guest does to its disk outlives the run. Its journal and kernel log
# are left in the output directory as journal.txt and dmesg.txt.
set -uo pipefail
here=$(dirname "$(readlink -f "$0")")
in=$PWD out='' peer='' limit=300 verbose='' mode=run cold=''
while getopts s:t:i:o:p:bcvw o; do
    case "$o" in
        s) VMRIG_SUITE=$OPTARG ;; t) limit=$OPTARG ;; i) in=$OPTARG ;; o) out=$OPTARG ;;
        p) peer=$OPTARG ;; b) mode=console ;; w) mode=warm ;; c) cold=1 ;; v) verbose=1 ;; *) exit 125 ;;
    esac
done
shift $((OPTIND - 1))
# shellcheck source=config.sh
. "$here/config.sh"
export VMRIG_SUITE
[ "$mode" != run ] || [ $# -gt 0 ] || { echo "vmrig: no command" >&2; exit 125; }
img=$("$here/build-image.sh") || exit 125
vmrig_choose_accel "$img"
state=$(vmrig_state_file "$img")
say() { echo "vmrig: $*" >&2; }
if [ $mode = run ] && [ -z "$cold" ] && [ ! -e "$state" ]; then
    VMRIG_EXTRA_DISK='' "$0" -w || say "no snapshot; booting cold"
fi

tmp=$(mktemp -d) || exit 125
qpid=''
helpers=() peerpid=''
finish() {
    [ -z "$qpid" ] || kill -KILL "$qpid" 2>/dev/null
    [ ${#helpers[@]} -eq 0 ] || kill "${helpers[@]}" 2>/dev/null
    [ -z "$peerpid" ] || kill -- "-$peerpid" 2>/dev/null
    rm -rf "$tmp"
}
trap finish EXIT
trap 'exit 125' INT TERM
if [ $mode != run ]; then in=$tmp/in out=$tmp/out; mkdir "$in" "$out"; fi
[ -n "$out" ] || { out=$(mktemp -d) && say "output in $out"; }
mkdir -p "$out"
rm -f "$out/.rc"
[ $# -eq 0 ] || printf '%q ' "$@" >"$out/.command"

vmrig_qemu_args "$img" "$in" "$out" "$tmp"
if [ $mode = console ]; then
    qemu-system-x86_64 "${args[@]}" -serial mon:stdio
    exit
fi
for f in ctl log mon; do mkfifo "$tmp/$f.in" "$tmp/$f.out"; done
args+=(-chardev "pipe,id=ctl,path=$tmp/ctl" -device virtserialport,chardev=ctl,name=vmrig.ctl
    -chardev "pipe,id=log,path=$tmp/log" -device virtserialport,chardev=log,name=vmrig.log
    -chardev "pipe,id=mon,path=$tmp/mon" -mon chardev=mon,mode=readline
    -serial "file:$out/console.txt")
warm=''
if [ $mode = run ] && [ -z "$cold" ] && [ -e "$state" ]; then
    warm=1
    args+=(-incoming "exec:cat '$state'")
fi
exec 3<>"$tmp/ctl.in" 4<>"$tmp/ctl.out" 5<>"$tmp/log.in" 6<>"$tmp/log.out" 7<>"$tmp/mon.in" 8<>"$tmp/mon.out"
t0=$(date +%s%N)
since() { local d=$((($(date +%s%N) - t0) / 100000000)); echo "$((d / 10)).$((d % 10))"; }
qemu-system-x86_64 "${args[@]}" </dev/null 3>&- 4>&- 5>&- 6>&- 7>&- 8>&- &
qpid=$!
# The monitor's prompt must be drained, or QEMU stops when the pipe is full.
if [ $mode != warm ]; then cat <&8 >/dev/null & helpers+=($!); fi
cat <&6 & helpers+=($!)
if [ -n "$verbose" ]; then tail -s 0.2 -F "$out/console.txt" --pid "$qpid" 2>/dev/null >&2 & helpers+=($!); fi
go() { printf 'GO %s\n' "$(date +%s.%N)" >&3; }
[ -z "$warm" ] || go

rc=125 idle=0
start=$SECONDS
while :; do
    if [ $((SECONDS - start)) -ge "$limit" ]; then rc=124; say "time limit of $limit s"; break; fi
    if IFS= read -r -t 0.5 -u 4 line; then
        case "$line" in
            READY*)
                say "guest up after $(since) s"
                if [ $mode = warm ]; then
                    printf 'migrate_set_parameter max-bandwidth 10G\nmigrate "exec:cat >%s"\ninfo migrate\nquit\n' "'$state.$$'" >&7
                    wait "$qpid"; qpid=''
                    timeout 1 cat <&8 | tr -d '\r' | grep -a 'Migration status' >&2
                    [ -s "$state.$$" ] && mv "$state.$$" "$state" && rc=0
                    break
                fi
                go ;;
            RUN*) # only now: a camera plugged in while the snapshot loads would be forgotten
                say "guest runs after $(since) s"
                if [ -n "$peer" ]; then
                    VMRIG_USB=$tmp VMRIG_OUT=$out setsid bash "$peer" </dev/null 3>&- 4>&- 5>&- 6>&- 7>&- 8>&- &
                    peerpid=$!
                fi ;;
            DONE*)
                rc=$(cat "$out/.rc" 2>/dev/null || echo 125)
                [ "$rc" != 125 ] || { say "guest: ${line#DONE }"; tail -n 5 "$out/console.txt" >&2; }
                break ;;
        esac
    elif [ $mode = run ] && [ -e "$out/.rc" ] && ((++idle >= 10)); then # the word got lost, the result did not
        rc=$(cat "$out/.rc"); break
    elif ! kill -0 "$qpid" 2>/dev/null; then
        say "the guest stopped by itself"; tail -n 20 "$out/console.txt" >&2; break
    fi
done
# Results are on the host already (9p writes through): no orderly power-off.
[ -z "$qpid" ] || { kill -KILL "$qpid"; wait "$qpid"; qpid=''; } 2>/dev/null
sleep 0.1 # the last of the output
say "$(since) s, exit status $rc"
exit "$rc"
