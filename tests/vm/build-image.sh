#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Builds the guest of the VM test rig from Debian packages, once per set of
# settings: vmlinuz, initrd, root.qcow2. Prints the directory that holds them.
# Needs root (debootstrap), plus: debootstrap, qemu-utils, e2fsprogs, cpio, curl.
set -euo pipefail
here=$(dirname "$(readlink -f "$0")")
# shellcheck source=config.sh
. "$here/config.sh"

out=$(vmrig_image_dir)
if [ -e "$out/complete" ]; then echo "$out"; exit 0; fi
[ "$(id -u)" = 0 ] || { echo "vmrig: building the image needs root" >&2; exit 1; }
mkdir -p "$VMRIG_CACHE/debs-$VMRIG_SUITE" "$out"
exec 9>"$out/lock"; flock 9
if [ -e "$out/complete" ]; then echo "$out"; exit 0; fi
log() { echo "vmrig: $*" >&2; }

work=$(mktemp -d "$VMRIG_CACHE/build.XXXXXX")
trap 'rm -rf --one-file-system "$work"' EXIT
root=$work/root

# The plain Debian tree is cached by itself: changing the guest's scripts must
# not install everything again.
base=$VMRIG_CACHE/base-$VMRIG_SUITE-$( { echo "$VMRIG_MIRROR"; vmrig_packages; } | sha256sum | cut -c1-12).tar
mkdir -p "$root"
if [ ! -s "$base" ]; then
    log "installing $VMRIG_SUITE"
    debootstrap --variant=minbase --cache-dir="$VMRIG_CACHE/debs-$VMRIG_SUITE" \
        --include="$(vmrig_packages)" "$VMRIG_SUITE" "$root" "$VMRIG_MIRROR" >"$out/debootstrap.log" 2>&1 ||
        { tail -n 20 "$out/debootstrap.log" >&2; exit 1; }
    tar -C "$root" --numeric-owner --exclude='./var/cache/apt/archives/*.deb' -cf "$base.part" . && mv "$base.part" "$base"
else
    tar -C "$root" --numeric-owner -xf "$base"
fi

log "unpacking the kernel"   # unpacked, not installed: no initramfs-tools run
pkg=$(chroot "$root" apt-cache depends --important linux-image-amd64 | awk '$1=="Depends:"{print $2; exit}')
( cd "$work" && chroot "$root" apt-get download --print-uris "$pkg" |
    awk -F"'" '{print $2}' >uri && read -r u <uri &&
    deb="$VMRIG_CACHE/debs-$VMRIG_SUITE/${u##*/}" &&
    { [ -s "$deb" ] || { curl -fsS -o "$deb.part" "$u" && mv "$deb.part" "$deb"; }; } &&
    dpkg-deb -x "$deb" kernel )
mods=$(echo "$work"/kernel/lib/modules/* "$work"/kernel/usr/lib/modules/* | tr ' ' '\n' | grep -v '\*' | head -n 1)
kver=${mods##*/}
install -m 644 "$work/kernel/boot/vmlinuz-$kver" "$out/vmlinuz"
install -m 644 "$work/kernel/boot/config-$kver" "$out/config"
mkdir -p "$root/usr/lib/modules/$kver"
for d in "${VMRIG_MODULE_DIRS[@]}"; do
    for f in "$mods/$d" "$mods/$d".ko "$mods/$d".ko.xz; do
        [ -e "$f" ] || continue
        mkdir -p "$root/usr/lib/modules/$kver/$(dirname "$d")"
        cp -a "$f" "$root/usr/lib/modules/$kver/$(dirname "$d")/"
    done
done
cp "$mods"/modules.{builtin,order} "$root/usr/lib/modules/$kver/"
[ -e "$mods/modules.builtin.modinfo" ] && cp "$mods/modules.builtin.modinfo" "$root/usr/lib/modules/$kver/"
chroot "$root" depmod "$kver"

log "configuring"
install -m 755 "$here/guest/vmrig-agent" "$root/usr/local/sbin/vmrig-agent"
install -m 644 "$here/guest/vmrig-agent.service" "$root/etc/systemd/system/vmrig-agent.service"
echo vmrig >"$root/etc/hostname"
echo "127.0.0.1 localhost vmrig" >"$root/etc/hosts"
: >"$root/etc/fstab"
printf 'root::0:0:root:/root:/bin/bash\n' >"$work/pw" # empty password, console only
sed -i 's|^root:[^:]*:|root::|' "$root/etc/shadow"
mkdir -p "$root/etc/systemd/system/serial-getty@ttyS0.service.d" "$root/etc/modprobe.d" "$root/vmrig"
cat >"$root/etc/systemd/system/serial-getty@ttyS0.service.d/autologin.conf" <<'G'
[Service]
ExecStart=
ExecStart=-/sbin/agetty --autologin root --keep-baud 115200 %I vt220
G
# vivid must not come up by itself with defaults; tests load it as they need.
echo "blacklist vivid" >"$root/etc/modprobe.d/vmrig.conf"
mkdir -p "$root/etc/systemd/journald.conf.d"
printf '[Journal]\nStorage=volatile\n' >"$root/etc/systemd/journald.conf.d/vmrig.conf"
for u in apt-daily.timer apt-daily-upgrade.timer dpkg-db-backup.timer e2scrub_all.timer e2scrub_reap.service \
         fstrim.timer getty@tty1.service systemd-timesyncd.service systemd-pstore.service \
         systemd-update-utmp.service systemd-update-utmp-runlevel.service; do
    ln -sf /dev/null "$root/etc/systemd/system/$u"
done
chroot "$root" systemctl enable vmrig-agent.service >/dev/null 2>&1
rm -rf "$root"/var/cache/apt/* "$root"/var/lib/apt/lists/* "$root"/usr/share/{doc,man,locale,info}/* "$root"/var/log/*

log "initrd"
ird=$work/initrd
mkdir -p "$ird"/{bin,m,dev,proc,root,lower,rw}
cp "$root/bin/busybox" "$ird/bin/"
install -m 755 "$here/guest/initrd-init" "$ird/init"
for m in virtio_pci virtio_blk crc32c_generic ext4 overlay; do
    chroot "$root" modprobe -S "$kver" --show-depends "$m" | awk '$1=="insmod"{print $2}'
done | awk '!s[$0]++' | while read -r f; do
    b=$(basename "$f"); case "$b" in
        *.xz) xz -dc "$root$f" >"$ird/m/${b%.xz}"; b=${b%.xz} ;;
        *) cp "$root$f" "$ird/m/$b" ;;
    esac
    echo "$b" >>"$ird/modules.list"
done
( cd "$ird" && find . | cpio --quiet -o -H newc ) | gzip -1 >"$out/initrd"

log "root file system"
mke2fs -q -t ext4 -O ^has_journal -m 0 -L vmrig -d "$root" "$work/root.img" "${VMRIG_DISK_MB}M" >/dev/null
qemu-img convert -O qcow2 "$work/root.img" "$out/root.qcow2"
du -sm "$root" | awk '{print "vmrig: guest files "$1" MB"}' >&2
touch "$out/complete"
log "done: $(du -sm "$out" | cut -f1) MB in the cache"
echo "$out"
