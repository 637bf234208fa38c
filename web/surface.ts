// SPDX-License-Identifier: Apache-2.0
// What the scene is drawn on: WebGL, or where there is none a plain canvas with lines alone.

import { Matrix, project, Vector } from "./matrix";

export type Rgb = [number, number, number];  // 0..1

/** Triangles with the normal of their face at each corner. */
export interface Mesh { corners: Float32Array; normals: Float32Array; low: Vector; high: Vector }

export interface Surface {
  /** Whether meshes are bodies on it. */
  readonly solid: boolean;
  begin(view: Matrix, ground: Rgb): void;
  mesh(mesh: Mesh, place: Matrix, color: Rgb): void;
  /** Pairs of x, y, z, opacity; `over` what stands before them. */
  lines(ends: number[], color: Rgb, over?: boolean): void;
  points(places: number[], color: Rgb, size: number): void;
}

/** Reads what the daemon sends (docs/api.md, "Meshes"). */
export function readMesh(bytes: ArrayBuffer): Mesh {
  const data = new DataView(bytes);
  if (bytes.byteLength < 36 || data.getUint32(0, true) !== 0x314d4c53) throw new Error("that is no mesh");
  const vertices = data.getUint32(4, true), faces = data.getUint32(8, true);
  const vector = (at: number): Vector => [0, 4, 8].map((k) => data.getFloat32(at + k, true)) as Vector;
  const low = vector(12), high = vector(24);
  const shares = new Uint16Array(bytes, 36, 3 * vertices), behind = 36 + Math.ceil(6 * vertices / 4) * 4;
  const indices = vertices <= 65536 ? new Uint16Array(bytes, behind, 3 * faces) : new Uint32Array(bytes, behind, 3 * faces);
  const corners = new Float32Array(9 * faces), normals = new Float32Array(9 * faces);
  for (let i = 0; i < 3 * faces; ++i) {
    for (let k = 0; k < 3; ++k) corners[3 * i + k] = low[k] + shares[3 * indices[i] + k] / 65535 * (high[k] - low[k]);
  }
  for (let f = 0; f < faces; ++f) {
    const c = corners.subarray(9 * f, 9 * f + 9);
    const [ax, ay, az, bx, by, bz] = [c[3] - c[0], c[4] - c[1], c[5] - c[2], c[6] - c[0], c[7] - c[1], c[8] - c[2]];
    const n = [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], size = Math.hypot(n[0], n[1], n[2]) || 1;
    for (let i = 0; i < 9; ++i) normals[9 * f + i] = n[i % 3] / size;
  }
  return { corners, normals, low, high };
}

const SOLID = ["attribute vec3 place; attribute vec3 normal; uniform mat4 view, model; varying float light;" +
  "void main() { gl_Position = view * model * vec4(place, 1.0); vec3 n = mat3(model) * normal;" +
  "light = 0.6 + 0.45 * abs(dot(n, normalize(vec3(0.4, 0.3, 0.85)))) + 0.15 * abs(n.x); }",
"precision mediump float; uniform vec3 color; varying float light; void main() { gl_FragColor = vec4(color * light, 1.0); }"];
const PLAIN = ["attribute vec4 place; uniform mat4 view; uniform float size; varying float opacity;" +
  "void main() { gl_Position = view * vec4(place.xyz, 1.0); gl_PointSize = size; opacity = place.w; }",
"precision mediump float; uniform vec3 color; varying float opacity; void main() { gl_FragColor = vec4(color, opacity); }"];

class GlSurface implements Surface {
  readonly solid = true;
  private solidProgram!: WebGLProgram;
  private plainProgram!: WebGLProgram;
  private scratch!: WebGLBuffer;
  private held = new Map<Mesh, { corners: WebGLBuffer; normals: WebGLBuffer }>();
  private view: Matrix = new Float32Array(16);
  private lost = false;

  constructor(private readonly canvas: HTMLCanvasElement, private readonly gl: WebGLRenderingContext) {
    this.make();
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();  // it comes back
      this.lost = true;
    });
    canvas.addEventListener("webglcontextrestored", () => {
      this.held = new Map();
      this.make();
      this.lost = false;
    });
  }

  private make(): void {
    const gl = this.gl;
    this.solidProgram = this.program(SOLID);
    this.plainProgram = this.program(PLAIN);
    this.scratch = this.buffer(null);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE);
  }

  private program([vertex, fragment]: string[]): WebGLProgram {
    const gl = this.gl, made = gl.createProgram();
    if (!made) throw new Error("no program");
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]] as [number, string][]) {
      const shader = gl.createShader(kind);
      if (!shader) throw new Error("no shader");
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(made) ?? "");
    return made;
  }

  private buffer(data: Float32Array | null): WebGLBuffer {
    const gl = this.gl, made = gl.createBuffer();
    if (!made) throw new Error("no buffer");
    gl.bindBuffer(gl.ARRAY_BUFFER, made);
    if (data) gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    return made;
  }

  private attribute(program: WebGLProgram, name: string, buffer: WebGLBuffer, size: number): void {
    const gl = this.gl, at = gl.getAttribLocation(program, name);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, size, gl.FLOAT, false, 0, 0);
  }

  begin(view: Matrix, ground: Rgb): void {
    const gl = this.gl;
    this.view = view;
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(...ground, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  }

  mesh(mesh: Mesh, place: Matrix, color: Rgb): void {
    if (this.lost) return;
    const gl = this.gl, program = this.solidProgram;
    let held = this.held.get(mesh);
    if (!held) this.held.set(mesh, held = { corners: this.buffer(mesh.corners), normals: this.buffer(mesh.normals) });
    gl.useProgram(program);
    gl.uniformMatrix4fv(gl.getUniformLocation(program, "view"), false, this.view);
    gl.uniformMatrix4fv(gl.getUniformLocation(program, "model"), false, place);
    gl.uniform3f(gl.getUniformLocation(program, "color"), ...color);
    this.attribute(program, "place", held.corners, 3);
    this.attribute(program, "normal", held.normals, 3);
    gl.drawArrays(gl.TRIANGLES, 0, mesh.corners.length / 3);
  }

  lines(ends: number[], color: Rgb, over = false): void {
    if (over) this.gl.disable(this.gl.DEPTH_TEST);
    this.plain(this.gl.LINES, ends, color, 1);
    if (over) this.gl.enable(this.gl.DEPTH_TEST);
  }

  points(places: number[], color: Rgb, size: number): void { this.plain(this.gl.POINTS, places, color, size); }

  private plain(kind: number, places: number[], color: Rgb, size: number): void {
    if (this.lost || places.length === 0) return;
    const gl = this.gl, program = this.plainProgram;
    gl.useProgram(program);
    gl.uniformMatrix4fv(gl.getUniformLocation(program, "view"), false, this.view);
    gl.uniform3f(gl.getUniformLocation(program, "color"), ...color);
    gl.uniform1f(gl.getUniformLocation(program, "size"), size);
    this.attribute(program, "place", this.scratch, 4);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(places), gl.STREAM_DRAW);
    gl.drawArrays(kind, 0, places.length / 4);
  }
}

/** Bodies are boxes on it, and nothing hides anything. */
class FlatSurface implements Surface {
  readonly solid = false;
  private view: Matrix = new Float32Array(16);

  constructor(private readonly canvas: HTMLCanvasElement, private readonly g: CanvasRenderingContext2D) {}

  begin(view: Matrix, ground: Rgb): void {
    this.view = view;
    this.g.fillStyle = this.style(ground, 1);
    this.g.fillRect(0, 0, this.canvas.width, this.canvas.height);
  }

  mesh(mesh: Mesh, place: Matrix, color: Rgb): void {
    const corner = (i: number): Vector => {
      const p: Vector = [0, 1, 2].map((k) => (i >> k & 1 ? mesh.high : mesh.low)[k]) as Vector;
      return [0, 1, 2].map((r) => place[r] * p[0] + place[4 + r] * p[1] + place[8 + r] * p[2] + place[12 + r]) as Vector;
    };
    const ends: number[] = [];
    for (let i = 0; i < 8; ++i) {
      for (const bit of [1, 2, 4]) if (!(i & bit)) ends.push(...corner(i), 1, ...corner(i | bit), 1);
    }
    this.lines(ends, color);
  }

  lines(ends: number[], color: Rgb): void {
    const g = this.g;
    for (let i = 0; i < ends.length; i += 8) {
      const a = this.pixel(ends, i), b = this.pixel(ends, i + 4);
      if (!a || !b) continue;
      g.strokeStyle = this.style(color, ends[i + 3]);
      g.beginPath();
      g.moveTo(...a);
      g.lineTo(...b);
      g.stroke();
    }
  }

  points(places: number[], color: Rgb, size: number): void {
    for (let i = 0; i < places.length; i += 4) {
      const at = this.pixel(places, i);
      this.g.fillStyle = this.style(color, places[i + 3]);
      if (at) this.g.fillRect(at[0] - size / 2, at[1] - size / 2, size, size);
    }
  }

  private pixel(from: number[], at: number): [number, number] | null {
    const [x, y, w] = project(this.view, [from[at], from[at + 1], from[at + 2]]);
    return w < 1e-3 ? null : [(x / w + 1) / 2 * this.canvas.width, (1 - y / w) / 2 * this.canvas.height];
  }

  private style(color: Rgb, opacity: number): string {
    return `rgb(${color.map((value) => Math.round(255 * value)).join(" ")} / ${opacity})`;
  }
}

export function makeSurface(canvas: HTMLCanvasElement): Surface | null {
  if (new URLSearchParams(location.search).get("webgl") !== "off") {
    try {
      const gl = canvas.getContext("webgl", { antialias: true });
      if (gl) return new GlSurface(canvas, gl);
    } catch {
      return null;  // it was there and does not work: the canvas is spoilt for anything else
    }
  }
  const plain = canvas.getContext("2d");
  return plain && new FlatSurface(canvas, plain);
}
