# SPDX-License-Identifier: Apache-2.0
"""A camera with ONVIF PTZ, written from the specifications: SOAP 1.2 over HTTP with digest authentication (RFC 7616, MD5 as
cameras have it). It turns as moving_head.MovingHead does; shares nothing with the daemon."""
import collections
import hashlib
import http.server
import math
import re
import threading
import time
import xml.etree.ElementTree

from moving_head import MovingHead

GENERIC = "http://www.onvif.org/ver10/tptz/PanTiltSpaces/PositionGenericSpace"
DEGREES = "http://www.onvif.org/ver10/tptz/PanTiltSpaces/SphericalPositionSpaceDegrees"
ENVELOPE = ('<?xml version="1.0"?><SOAP-ENV:Envelope xmlns:SOAP-ENV="http://www.w3.org/2003/05/soap-envelope" '
            'xmlns:tt="http://www.onvif.org/ver10/schema" xmlns:tptz="http://www.onvif.org/ver20/ptz/wsdl" '
            'xmlns:trt="http://www.onvif.org/ver10/media/wsdl" xmlns:tds="http://www.onvif.org/ver10/device/wsdl">'
            "<SOAP-ENV:Body>{}</SOAP-ENV:Body></SOAP-ENV:Envelope>")
FAULT = ("<SOAP-ENV:Fault><SOAP-ENV:Code><SOAP-ENV:Value>SOAP-ENV:Sender</SOAP-ENV:Value></SOAP-ENV:Code>"
         '<SOAP-ENV:Reason><SOAP-ENV:Text xml:lang="en">{}</SOAP-ENV:Text></SOAP-ENV:Reason></SOAP-ENV:Fault>')


def md5(text):
    return hashlib.md5(text.encode()).hexdigest()


class OnvifCamera(MovingHead):
    PER_UNIT = 170.0  # degrees
    USER, PASSWORD, REALM = "operator", 'a "secret" & more', "camera"

    def __init__(self, space=GENERIC, moves=("Absolute", "Continuous", "Relative"), tells=True):
        self.space, self.moves, self.tells = space, moves, tells
        self.requests = collections.Counter()
        self.timeout = None  # when a continuous move ends by itself
        self.shown = None  # the position that it keeps saying while frozen
        self.nonce, self.refused = md5(str(time.time())), 0
        super().__init__()  # its VISCA side is not used
        handler = type("Handler", (Handler,), {"camera": self})
        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
        self.server.daemon_threads = True
        self.http_port = self.server.server_address[1]
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def move(self, now):
        if self.timeout and now >= self.timeout:
            self.timeout = None
            self.coming.append((now, self.halt, self.speed))
        super().move(now)

    def halt(self):
        return [angle + rate * abs(rate) / 2 / self.ACCELERATION for angle, rate in zip(self.angles, self.rates)]

    def velocity(self, shares):
        """Turns on at so many shares of the fastest; an axis without one stands."""
        def goal():
            return [there if share == 0 else math.copysign(1e4, share) for share, there in zip(shares, self.halt())]
        self.coming.append((time.monotonic() + self.LATENCY_S, goal, [max(abs(share), 0.02) * self.FASTEST for share in shares]))

    def nodes(self):
        spaces = {"Absolute": f"<tt:AbsolutePanTiltPositionSpace><tt:URI>{self.space}</tt:URI></tt:AbsolutePanTiltPositionSpace>",
                  "Continuous": "<tt:ContinuousPanTiltVelocitySpace><tt:URI>v</tt:URI></tt:ContinuousPanTiltVelocitySpace>",
                  "Relative": "<tt:RelativePanTiltTranslationSpace><tt:URI>t</tt:URI></tt:RelativePanTiltTranslationSpace>"}
        return ('<tptz:GetNodesResponse><tptz:PTZNode token="other"><tt:SupportedPTZSpaces/></tptz:PTZNode>'
                '<tptz:PTZNode token="n2"><tt:SupportedPTZSpaces>' + "".join(spaces[move] for move in self.moves) +
                "</tt:SupportedPTZSpaces></tptz:PTZNode></tptz:GetNodesResponse>")

    def unit(self):
        return 1.0 if self.space == DEGREES else self.PER_UNIT

    def status(self):
        pan, tilt = self.at(time.monotonic())
        moving = math.dist(self.angles, self.goal) > 0.05
        if self.mode == "frozen":
            self.shown = self.shown or (pan, tilt)
            (pan, tilt), moving = self.shown, True
        else:
            self.shown = None
        if self.mode == "jumps":
            pan = 160 if time.monotonic() % 0.2 < 0.1 else -160
        x, y = pan / self.unit(), tilt / self.unit()
        if self.mode == "nonsense":
            x = "NaN"
        return (f'<tptz:GetStatusResponse><tptz:PTZStatus><tt:Position><tt:PanTilt x="{x}" y="{y}" space="{self.space}"/>'
                '<tt:Zoom x="0"/></tt:Position><tt:MoveStatus><tt:PanTilt>'
                f'{"MOVING" if moving else "IDLE"}</tt:PanTilt><tt:Zoom>IDLE</tt:Zoom></tt:MoveStatus>'
                "<tt:UtcTime>2026-01-01T00:00:00Z</tt:UtcTime></tptz:PTZStatus></tptz:GetStatusResponse>")

    def reply(self, body):
        """Status and text; None: no answer at all."""
        root = xml.etree.ElementTree.fromstring(body)
        request = root.find("{http://www.w3.org/2003/05/soap-envelope}Body")[0]
        name = request.tag.split("}")[1]
        if self.mode == "silent":
            return None
        if name == "GetCapabilities":
            address = "http://192.0.2.1:8000/onvif/"  # behind a router it knows itself by another address
            return 200, ("<tds:GetCapabilitiesResponse><tds:Capabilities>"
                         f"<tt:Media><tt:XAddr>{address}media</tt:XAddr></tt:Media>"
                         f"<tt:PTZ><tt:XAddr>{address}ptz</tt:XAddr></tt:PTZ></tds:Capabilities></tds:GetCapabilitiesResponse>")
        if name == "GetProfiles":
            return 200, ('<trt:GetProfilesResponse><trt:Profiles token="still"><tt:Name>a</tt:Name></trt:Profiles>'
                         '<trt:Profiles token="turns_1"><tt:PTZConfiguration token="p"><tt:NodeToken>n2</tt:NodeToken></tt:PTZConfiguration></trt:Profiles></trt:GetProfilesResponse>')
        self.requests[name] += 1
        if name == "GetNodes" and self.tells:
            return 200, self.nodes()
        token = next((node.text for node in request.iter() if node.tag.endswith("}ProfileToken")), "")
        if token != "turns_1":
            return 400, FAULT.format("no such profile")
        if name == "GetStatus":
            return 200, self.status()
        if name in [move + "Move" for move in self.moves] + ["Stop"] and self.mode != "stuck":
            return self.order(name, request)
        return 500, FAULT.format(f"{name} is not possible")

    def order(self, name, request):
        now = time.monotonic()
        values = [[float(node.get(key)) for key in "xy"] for node in request.iter() if node.tag.endswith("}PanTilt") and node.get("x")]
        if name == "Stop":
            self.timeout = None
            self.coming.append((now + self.LATENCY_S, self.halt, list(self.speed)))
        elif name == "ContinuousMove":
            assert max(abs(share) for share in values[0]) <= 1, values
            assert next(node.text for node in request.iter() if node.tag.endswith("}Timeout")) == "PT1S"
            self.orders += 1
            self.timeout = now + 1 + self.LATENCY_S
            self.velocity(values[0])
        elif name == "RelativeMove":
            self.orders += 1
            way = [value * self.unit() for value in values[0]]
            self.coming.append((now + self.LATENCY_S, lambda: [angle + more for angle, more in zip(self.angles, way)],
                                [share * self.FASTEST for share in values[1]]))
        else:
            place, speed = [node for node in request.iter() if node.tag.endswith("}PanTilt")]
            if place.get("space") != self.space:
                return 400, FAULT.format("no such space")
            goal = [float(place.get(key)) * self.unit() for key in "xy"]
            self.orders += 1
            self.goals.append(goal)
            if self.mode == "backwards":
                goal = [2 * angle - there for angle, there in zip(self.angles, goal)]
            rates = [float(speed.get(key)) * self.FASTEST for key in "xy"]
            self.coming.append((time.monotonic() + self.LATENCY_S, goal, rates))
        return 200, f"<tptz:{name}Response/>"

    def close(self):
        self.server.shutdown()
        self.server.server_close()
        super().close()


class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    camera = None

    def log_message(self, *_):
        pass

    def authorized(self):
        camera, header = self.camera, self.headers.get("Authorization", "")
        fields = {key: quoted or plain for key, quoted, plain in re.findall(r'(\w+)=(?:"((?:[^"\\]|\\.)*)"|([^\s,]+))', header)}
        if not header.startswith("Digest ") or fields.get("nonce") != camera.nonce:
            return False
        secret = md5(f"{camera.USER}:{camera.REALM}:{camera.PASSWORD}")
        request = md5(f"POST:{self.path}")
        wanted = md5(":".join([secret, camera.nonce, fields["nc"], fields["cnonce"], "auth", request]))
        return fields["username"] == camera.USER and fields["uri"] == self.path and fields["response"] == wanted

    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"]))
        if not self.authorized():
            self.camera.refused += 1
            self.send_response(401)
            self.send_header("WWW-Authenticate",
                             f'Digest realm="{self.camera.REALM}", nonce="{self.camera.nonce}", qop="auth", algorithm=MD5')
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        answer = self.camera.reply(body)
        if answer is None:
            time.sleep(0.6)
            self.close_connection = True
            return
        text = ENVELOPE.format(answer[1]).encode()
        if self.camera.mode == "cut":
            text = text[:len(text) // 2]
        self.send_response(answer[0])
        self.send_header("Content-Type", "application/soap+xml")
        self.send_header("Content-Length", str(len(text)))
        self.end_headers()
        self.wfile.write(text)
