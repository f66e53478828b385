"use strict";
// The organ in WebGL: a lit surface, seen in parallel projection, coloured by a number per vertex.
// Plotly's own 3D takes some fifteen seconds to its first picture where a processor draws it.
const organView = (() => {
  const VERTEX = `#version 300 es
    in vec3 place; in vec3 normal; in float share;
    uniform mat4 seen; uniform vec3 toward; uniform float size;
    out float lit; out float at;
    void main() {
      gl_Position = seen * vec4(place, 1.0);
      gl_PointSize = size;
      lit = 0.62 + 0.38 * max(0.0, dot(normalize(normal), toward));
      at = share;
    }`;
  const FRAGMENT = `#version 300 es
    precision mediump float;
    in float lit; in float at;
    uniform sampler2D scale; uniform vec4 plain;
    out vec4 colour;
    void main() {
      colour = plain.a > 0.0 ? plain : vec4(lit * texture(scale, vec2(clamp(at, 0.0, 1.0), 0.5)).rgb, 1.0);
    }`;

  function shader(gl, kind, text) {
    const made = gl.createShader(kind);
    gl.shaderSource(made, text);
    gl.compileShader(made);
    if (!gl.getShaderParameter(made, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(made));
    return made;
  }

  function program(gl) {
    const made = gl.createProgram();
    gl.attachShader(made, shader(gl, gl.VERTEX_SHADER, VERTEX));
    gl.attachShader(made, shader(gl, gl.FRAGMENT_SHADER, FRAGMENT));
    gl.linkProgram(made);
    gl.useProgram(made);
    return made;
  }

  /** Colours as a texture of one row. */
  function colours(gl, scale) {
    const bytes = new Uint8Array(scale.flatMap((hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16)).concat(255)));
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, scale.length, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    for (const [key, value] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]]) gl.texParameteri(gl.TEXTURE_2D, key, value);
  }

  /** Sum of the normals of the triangles at each vertex. */
  function normals(places, triangles) {
    const found = new Float32Array(places.length);
    for (let t = 0; t < triangles.length; t += 3) {
      const [a, b, c] = [3 * triangles[t], 3 * triangles[t + 1], 3 * triangles[t + 2]];
      const u = [0, 1, 2].map((d) => places[b + d] - places[a + d]), v = [0, 1, 2].map((d) => places[c + d] - places[a + d]);
      const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      for (const at of [a, b, c]) for (let d = 0; d < 3; d += 1) found[at + d] += n[d];
    }
    return found;
  }

  /** Rightward, upward and toward the eye, from two angles [rad]; z is upright. */
  function axes({ around, above }) {
    const [c, s, ca, sa] = [Math.cos(around), Math.sin(around), Math.cos(above), Math.sin(above)];
    return { right: [-s, c, 0], up: [-sa * c, -sa * s, ca], toward: [ca * c, ca * s, sa] };
  }

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

  /** Columns of the matrix from places to the canvas. */
  function matrix(eye, centre, half, aspect) {
    const { right, up, toward } = axes(eye), k = eye.zoom / half;
    const rows = [[right, k / aspect], [up, k], [toward, -0.2 / half]];
    return new Float32Array([0, 1, 2].flatMap((d) => [...rows.map(([axis, f]) => axis[d] * f), 0])
      .concat([...rows.map(([axis, f]) => -f * dot(axis, centre)), 1]));
  }

  /**
   * A canvas that draws triangles (flat indices) about a centre within a half width. `draw(shown,
   * eye)`: places, shares of the colour scale, marks [{place, colour, size}]. `nearest(x, y)`: the
   * vertex at a place [px] of the last picture, -1 for none. Null where there is no WebGL.
   */
  function make(canvas, triangles, scale, centre, half) {
    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!gl) return null;
    const made = program(gl), at = (name) => gl.getUniformLocation(made, name);
    colours(gl, scale);
    const buffers = Object.fromEntries(["place", "normal", "share"].map((name) => [name, gl.createBuffer()]));
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(triangles), gl.STATIC_DRAW);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1, 1);  // marks on the surface lie before it
    let last = null;

    function give(name, values, size) {
      const place = gl.getAttribLocation(made, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers[name]);
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, gl.FLOAT, false, 0, 0);
    }

    function draw(shown, eye, paper) {
      const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
      canvas.width = Math.max(1, Math.round(box.width * ratio));
      canvas.height = Math.max(1, Math.round(box.height * ratio));
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.clearColor(...paper, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      const seen = matrix(eye, centre, half, canvas.width / canvas.height);
      gl.uniformMatrix4fv(at("seen"), false, seen);
      gl.uniform3fv(at("toward"), axes(eye).toward);
      gl.uniform4f(at("plain"), 0, 0, 0, 0);
      give("place", shown.places, 3);
      give("normal", normals(shown.places, triangles), 3);
      give("share", shown.shares, 1);
      gl.drawElements(gl.TRIANGLES, triangles.length, gl.UNSIGNED_INT, 0);
      for (const mark of shown.marks) if (mark.kind === "on") drawMark(mark, ratio);
      gl.disable(gl.DEPTH_TEST);
      for (const mark of shown.marks) if (mark.kind !== "on") drawMark(mark, ratio);
      gl.enable(gl.DEPTH_TEST);
      last = { seen, places: shown.places, box };
    }

    /** Points, or a line of them, of one colour; over all else but where they are on the surface. */
    function drawMark({ places, colour, size, kind }, ratio) {
      give("place", new Float32Array(places), 3);
      give("normal", new Float32Array(places.length).fill(1), 3);
      give("share", new Float32Array(places.length / 3), 1);
      gl.uniform4f(at("plain"), ...colour, 1);
      gl.uniform1f(at("size"), size * ratio);
      gl.drawArrays(kind === "line" ? gl.LINES : gl.POINTS, 0, places.length / 3);
    }

    /** Place on the canvas [px], and depth, of a point. */
    function project([x, y, z]) {
      const m = last.seen, to = (r) => m[r] * x + m[4 + r] * y + m[8 + r] * z + m[12 + r];
      return [0.5 * (1 + to(0)) * last.box.width, 0.5 * (1 - to(1)) * last.box.height, to(2)];
    }

    function nearest(x, y) {
      let best = -1, front = Infinity;
      for (let k = 0; last && k < last.places.length; k += 3) {
        const [px, py, depth] = project(last.places.subarray(k, k + 3));
        if (Math.hypot(px - x, py - y) < 12 && depth < front) { best = k / 3; front = depth; }
      }
      return best;
    }

    return { draw, nearest, project };
  }

  return { make, axes };
})();
