# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=bash disable=SC2034,SC2054
# Shared settings of the VM test rig. Sourced, not run.
# Every value can be overridden from the environment.

: "${VMRIG_SUITE:=bookworm}"                       # bookworm | trixie
# the package archive that this machine already uses
: "${VMRIG_MIRROR:=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' | head -n 1)}"
: "${VMRIG_CACHE:=${XDG_CACHE_HOME:-$HOME/.cache}/vmrig}"
: "${VMRIG_DISK_MB:=1400}"                         # size of the root file system (sparse)
: "${VMRIG_EXTRA_DISK:=}"                          # file of VMRIG_EXTRA_MB with a file system: /dev/vdb in the guest
VMRIG_EXTRA_MB=512                                 # the same for all, or no snapshot would fit
: "${VMRIG_CPUS:=2}"
: "${VMRIG_MEM:=1024}"
: "${VMRIG_ACCEL:=auto}"                            # kvm where a guest really boots under it, else tcg
: "${VMRIG_CPU:=}"                                 # CPU model shown to the guest; default: all it can be
: "${VMRIG_QEMU_EXTRA:=}"                           # more QEMU arguments, see vmrig_qemu_args
: "${VMRIG_EXTRA_PACKAGES:=}"                      # comma separated, part of the cache key

# Packages of the guest. Runtime only: programs under test are built outside
# and reach the guest through the shared directory.
vmrig_packages() {
    local p=systemd,systemd-sysv,udev,kmod,dbus,iproute2,nftables,procps,util-linux
    p+=,busybox-static,cpio,ca-certificates
    p+=,v4l-utils,usbip,usbutils,python3-minimal,libpython3-stdlib
    case "$VMRIG_SUITE" in
        bookworm) p+=,libcamera0.0.3,libaravis-0.8-0,libturbojpeg0 ;;
        trixie)   p+=,libcamera0.4,libcamera-ipa,libaravis-0.8-0,libturbojpeg0 ;;
        *) echo "vmrig: unknown suite '$VMRIG_SUITE'" >&2; return 2 ;;
    esac
    echo "$p${VMRIG_EXTRA_PACKAGES:+,$VMRIG_EXTRA_PACKAGES}"
}

# Directories of kernel modules kept in the guest (the rest is deleted).
VMRIG_MODULE_DIRS=(
    kernel/arch kernel/crypto kernel/lib kernel/fs/9p kernel/fs/netfs kernel/fs/fscache
    kernel/fs/ext4 kernel/fs/jbd2 kernel/fs/mbcache kernel/fs/overlayfs kernel/fs/fuse kernel/fs/configfs
    kernel/drivers/virtio kernel/drivers/block/virtio_blk kernel/drivers/net/virtio_net
    kernel/drivers/net/net_failover kernel/net/core kernel/drivers/net/veth
    kernel/drivers/net/dummy kernel/drivers/char/virtio_console kernel/drivers/char/hw_random
    kernel/drivers/char/ipmi kernel/drivers/watchdog/softdog kernel/drivers/watchdog/i6300esb
    kernel/drivers/media/common kernel/drivers/media/mc kernel/drivers/media/v4l2-core
    kernel/drivers/media/test-drivers kernel/drivers/media/usb/uvc kernel/drivers/media/cec
    kernel/drivers/media/rc kernel/drivers/usb kernel/drivers/ptp kernel/drivers/pps
    kernel/drivers/gpu/drm/drm kernel/drivers/i2c kernel/drivers/video
    kernel/net/9p kernel/net/sched kernel/net/netfilter kernel/net/ipv4 kernel/net/ipv6
    kernel/net/packet kernel/net/vmw_vsock kernel/net/802 kernel/net/llc kernel/net/bridge
    kernel/drivers/hid kernel/drivers/input kernel/sound/core
)

# Cache directory of the image that belongs to these settings.
vmrig_image_dir() {
    local here key
    here=$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")
    key=$( { echo "$VMRIG_SUITE $VMRIG_MIRROR $VMRIG_DISK_MB"; vmrig_packages
             cat "$here/config.sh" "$here/build-image.sh" "$here"/guest/*; } | sha256sum | cut -c1-12 )
    echo "$VMRIG_CACHE/$VMRIG_SUITE-$key"
}

# Settles VMRIG_ACCEL and VMRIG_CPU for the image in $1. That /dev/kvm opens says little: in some virtual
# machines a stock kernel hangs under it. So its first program must have run once; the answer is kept.
vmrig_choose_accel() {
    local answer
    if [ "$VMRIG_ACCEL" = auto ]; then
        answer=$VMRIG_CACHE/accel-$( { uname -r; qemu-system-x86_64 --version; } | sha256sum | cut -c1-12 )
        [ -s "$answer" ] || { vmrig_try_kvm "$1" >"$answer.$$" && mv "$answer.$$" "$answer"; }
        VMRIG_ACCEL=$(cat "$answer")
    fi
    case "$VMRIG_ACCEL" in
        kvm*) : "${VMRIG_CPU:=host}" ;;
        *) : "${VMRIG_CPU:=max}" ;;
    esac
    export VMRIG_ACCEL VMRIG_CPU
}
vmrig_try_kvm() {
    local said=''
    if [ -w /dev/kvm ]; then # without a disk the guest's first program says so and ends
        said=$(timeout -k 1 20 qemu-system-x86_64 -nodefaults -no-user-config -no-reboot -M q35 -accel kvm -cpu host \
            -m 512 -display none -kernel "$1/vmlinuz" -initrd "$1/initrd" -append "console=ttyS0 panic=-1" \
            -serial stdio </dev/null 2>/dev/null | tr -d '\0')
    fi
    case "$said" in
        *"vmrig: no root disk"*) echo kvm ;;
        *) echo tcg,thread=multi ;;
    esac
}

# Cache file of the booted guest's memory, for one QEMU build and machine shape.
vmrig_state_file() {
    echo "$1/state-$( { qemu-system-x86_64 --version; echo "$VMRIG_ACCEL $VMRIG_CPU $VMRIG_CPUS $VMRIG_MEM"; } | sha256sum | cut -c1-12 )"
}

# Sets the array "args" to the QEMU arguments for the image in $1, the shared
# directories $2 (in) and $3 (out), and the directory $4 for the sockets usb0 to
# usb3 into which fake USB cameras plug themselves. The disk is read-only: the
# guest writes to an overlay in its memory. So a memory snapshot stays valid, and
# many guests can share one image.
vmrig_qemu_args() {
    args=(-nodefaults -no-user-config -no-reboot -M q35 -accel "$VMRIG_ACCEL" -cpu "$VMRIG_CPU"
        -smp "$VMRIG_CPUS" -m "$VMRIG_MEM" -display none
        -kernel "$1/vmlinuz" -initrd "$1/initrd"
        -append "console=ttyS0 panic=-1 net.ifnames=0 mitigations=off nokaslr systemd.show_status=0 loglevel=4"
        -drive "file=$1/root.qcow2,if=none,id=root,format=qcow2,readonly=on"
        -device virtio-blk-pci,drive=root -device virtio-rng-pci -device i6300esb
        -fsdev "local,id=in,path=$2,security_model=none,readonly=on" -device virtio-9p-pci,fsdev=in,mount_tag=vmrig-in
        -fsdev "local,id=out,path=$3,security_model=none" -device virtio-9p-pci,fsdev=out,mount_tag=vmrig-out
        -device virtio-serial-pci -device qemu-xhci,p2=8,p3=8)
    local i extra=$VMRIG_EXTRA_DISK
    if [ -z "$extra" ]; then
        extra=$4/empty
        truncate -s "${VMRIG_EXTRA_MB}M" "$extra"
    fi
    args+=(-drive "file=$extra,if=none,id=extra,format=raw,readonly=on" -device virtio-blk-pci,drive=extra)
    for i in 0 1 2 3; do
        args+=(-chardev "socket,id=usb$i,path=$4/usb$i,server=on,wait=off" -device "usb-redir,chardev=usb$i")
    done
    # Extra arguments change the machine: use them with a cold boot (-c).
    # shellcheck disable=SC2206
    [ -z "$VMRIG_QEMU_EXTRA" ] || args+=($VMRIG_QEMU_EXTRA)
}
