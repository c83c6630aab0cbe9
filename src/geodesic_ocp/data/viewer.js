// Draws the scenes of one viewer; see viewer.py, which writes the data that this reads.
"use strict";
(function () {
  const root = document.currentScript.parentElement;
  const data = JSON.parse(root.querySelector('script[type="application/json"]').textContent);
  const canvases = [...root.querySelectorAll("canvas")];
  const button = root.querySelector("button");
  const slider = root.querySelector("input");
  const clock = root.querySelector("output");

  const BACKGROUND = [0.955, 0.962, 0.97];
  const SLOPE = Math.tan((13 * Math.PI) / 180); // of half the vertical angle of view
  const MARGIN = 0.92; // share of the view that the motion fills
  const SQUARE = 0.25; // side of the floor's squares [m]
  const INK = { hand: [0.106, 0.227, 0.361], target: [0.878, 0.482, 0] };
  const FAINT = 0.28; // opacity of lines behind the arm

  const SOLID = [
    `attribute vec3 place, normal;
     uniform mat4 model, view, projection;
     varying vec3 seen, bent;
     void main() {
       vec4 at = view * model * vec4(place, 1.0);
       seen = at.xyz;
       bent = (view * model * vec4(normal, 0.0)).xyz;
       gl_Position = projection * at;
     }`,
    // The face's own normal, and the bent one where the two nearly agree: round, with sharp edges.
    // Both face the eye, so that it does not matter which way round a file has its triangles.
    `#extension GL_OES_standard_derivatives : enable
     precision highp float;
     uniform vec3 colour;
     varying vec3 seen, bent;
     void main() {
       vec3 face = normalize(cross(dFdx(seen), dFdy(seen)));
       vec3 soft = bent / max(length(bent), 1e-9);
       soft *= dot(soft, face) < 0.0 ? -1.0 : 1.0;
       vec3 n = normalize(mix(face, soft, smoothstep(0.5, 0.8, dot(soft, face))));
       float key = max(dot(n, normalize(vec3(-0.45, 0.75, 0.6))), 0.0);
       float side = max(dot(n, normalize(vec3(0.9, 0.1, 0.35))), 0.0);
       float light = (0.34 + 0.52 * key + 0.16 * side + 0.1 * n.y) * (0.72 + 0.28 * n.z);
       gl_FragColor = vec4((0.06 + 0.94 * colour) * light * 1.12, 1.0);
     }`,
  ];
  // Lines as ribbons that face the eye: WebGL's own are one pixel wide.
  const LINE = [
    `attribute vec3 here, there;
     attribute vec2 edge; // side, and length so far [m]
     uniform mat4 view, projection;
     uniform vec2 size;
     uniform float width;
     varying float along;
     void main() {
       vec4 a = projection * view * vec4(here, 1.0), b = projection * view * vec4(there, 1.0);
       vec2 run = (b.xy / b.w - a.xy / a.w) * size;
       run /= max(length(run), 1e-6);
       gl_Position = a + vec4(vec2(-run.y, run.x) * edge.x * width / size * a.w, 0.0, 0.0);
       along = edge.y;
     }`,
    `precision highp float;
     uniform vec4 colour;
     uniform float dash; // length of a dash and of a gap [m]; none if 0
     varying float along;
     void main() {
       if (dash > 0.0 && mod(along, 2.0 * dash) > dash) discard;
       gl_FragColor = colour;
     }`,
  ];
  const DOT = [
    `attribute vec3 place;
     uniform mat4 view, projection;
     uniform float width;
     void main() {
       gl_Position = projection * view * vec4(place, 1.0);
       gl_PointSize = width;
     }`,
    `precision highp float;
     uniform vec4 colour;
     void main() {
       float r = length(gl_PointCoord - 0.5);
       if (r > 0.5) discard;
       gl_FragColor = vec4(r > 0.34 ? vec3(1.0) : colour.rgb, colour.a);
     }`,
  ];
  const FLOOR = [
    `attribute vec3 place;
     uniform mat4 view, projection;
     uniform vec3 middle;
     varying vec2 off;
     void main() { off = place.xy - middle.xy; gl_Position = projection * view * vec4(place, 1.0); }`,
    `precision highp float;
     uniform float reach;
     varying vec2 off;
     void main() { gl_FragColor = vec4(0.45, 0.5, 0.56, 0.6 * smoothstep(1.0, 0.2, length(off) / reach)); }`,
  ];

  // One context for all viewers of a page, since browsers allow only a few.
  function painter() {
    const canvas = document.createElement("canvas");
    const gl = canvas.getContext("webgl", { antialias: true, alpha: false });
    if (!gl || !gl.getExtension("OES_standard_derivatives")) return null;
    gl.getExtension("OES_element_index_uint");
    const programs = {};
    for (const [name, sources] of Object.entries({ SOLID, LINE, DOT, FLOOR })) {
      const program = gl.createProgram();
      sources.forEach((source, index) => {
        const shader = gl.createShader(index ? gl.FRAGMENT_SHADER : gl.VERTEX_SHADER);
        gl.shaderSource(shader, source);
        gl.compileShader(shader);
        if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) console.log(gl.getShaderInfoLog(shader));
        gl.attachShader(program, shader);
      });
      gl.linkProgram(program);
      if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return null;
      programs[name] = program;
    }
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    return { canvas, gl, programs };
  }
  if (window.geodesicPainter === undefined) window.geodesicPainter = painter();
  if (!window.geodesicPainter) {
    root.querySelector(".viewer-missing").hidden = false;
    canvases.forEach((canvas) => (canvas.hidden = true));
    root.querySelector(".viewer-bar").hidden = true;
    return;
  }
  const { canvas: sheet, gl, programs } = window.geodesicPainter;

  function decoded(text, kind) {
    return new kind(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
  }
  function buffer(values, target = gl.ARRAY_BUFFER) {
    const made = gl.createBuffer();
    gl.bindBuffer(target, made);
    gl.bufferData(target, values, gl.STATIC_DRAW);
    return made;
  }
  function normals(places, corners) {
    const sums = new Float32Array(places.length);
    for (let i = 0; i < corners.length; i += 3) {
      const [a, b, c] = [3 * corners[i], 3 * corners[i + 1], 3 * corners[i + 2]];
      const u = [0, 1, 2].map((k) => places[b + k] - places[a + k]);
      const v = [0, 1, 2].map((k) => places[c + k] - places[a + k]);
      const n = cross(u, v); // as long as twice the area, which weighs it
      for (const corner of [a, b, c]) for (let k = 0; k < 3; k++) sums[corner + k] += n[k];
    }
    for (let i = 0; i < sums.length; i += 3) {
      const length = Math.hypot(sums[i], sums[i + 1], sums[i + 2]) || 1;
      for (let k = 0; k < 3; k++) sums[i + k] /= length;
    }
    return sums;
  }
  function cross(u, v) {
    return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  }
  function dot(u, v) {
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
  }

  function ribbon(points) {
    const values = [];
    let run = 0;
    for (let i = 3; i < points.length; i += 3) {
      const a = [...points.subarray(i - 3, i)];
      const b = [...points.subarray(i, i + 3)];
      const end = run + Math.hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
      const corner = [[...a, ...b, 1, run], [...a, ...b, -1, run], [...b, ...a, -1, end], [...b, ...a, 1, end]];
      for (const each of [0, 1, 2, 2, 1, 3]) values.push(...corner[each]);
      run = end;
    }
    return { points, length: run, count: values.length / 8, corners: buffer(new Float32Array(values)) };
  }

  const time = decoded(data.time, Float64Array);
  const bodies = data.bodies.map((parts) =>
    parts.map((part) => {
      const places = decoded(part.vertices, Float32Array);
      const corners = decoded(part.triangles, part.bits === 16 ? Uint16Array : Uint32Array);
      return {
        link: part.link,
        colour: part.colour,
        count: corners.length,
        type: part.bits === 16 ? gl.UNSIGNED_SHORT : gl.UNSIGNED_INT,
        places: buffer(places),
        normals: buffer(normals(places, corners)),
        corners: buffer(corners, gl.ELEMENT_ARRAY_BUFFER),
      };
    })
  );
  const start = { turn: (data.view[0] * Math.PI) / 180, tilt: (data.view[1] * Math.PI) / 180, zoom: 1 };
  const scenes = data.scenes.map((scene, index) => {
    const { middle, offsets } = centred(decoded(scene.extremes, Float32Array));
    const span = 2 * Math.max(...offsets.map((each) => Math.hypot(...each)));
    const cells = Math.ceil((1.5 * span) / SQUARE) + 2;
    const [x, y] = [0, 1].map((k) => Math.round(middle[k] / SQUARE) * SQUARE);
    const lines = [];
    for (let i = -cells; i <= cells; i++) {
      const [a, b] = [i * SQUARE, cells * SQUARE];
      // In short pieces, that they fade as they should.
      for (let j = -cells; j < cells; j++) {
        const [from, to] = [j * SQUARE, (j + 1) * SQUARE];
        lines.push(x + a, y + from, scene.floor, x + a, y + to, scene.floor);
        lines.push(x + from, y + a, scene.floor, x + to, y + a, scene.floor);
      }
    }
    const actors = scene.actors.map((actor) => ({
      parts: bodies[actor.body],
      poses: Object.fromEntries(
        Object.entries(actor.poses).map(([link, text]) => [link, decoded(text, Float32Array)])
      ),
      lines: Object.entries(actor.lines).map(([kind, text]) => ({
        kind,
        ...ribbon(decoded(text, Float32Array)),
        dot: actor.dots[kind] ? buffer(decoded(actor.dots[kind], Float32Array)) : null,
      })),
    }));
    const floor = { lines: buffer(new Float32Array(lines)), count: lines.length / 3, reach: cells * SQUARE };
    const all = actors.flatMap((actor) => actor.lines);
    // The target's over the hand's, in dashes.
    all.sort((a, b) => (a.kind === b.kind ? 0 : a.kind < b.kind ? -1 : 1));
    return { middle, offsets, actors, lines: all, floor, canvas: canvases[index] };
  });

  let eye = { ...start };
  let now = time[0];
  let playing = false;

  // Axes of the camera: to the right, up, and towards the eye.
  function axes(view) {
    const back = [
      Math.sin(view.turn) * Math.cos(view.tilt),
      Math.cos(view.turn) * Math.cos(view.tilt),
      Math.sin(view.tilt),
    ];
    const right = [-Math.cos(view.turn), Math.sin(view.turn), 0];
    return [right, cross(back, right), back];
  }
  // The middle of points as the eye sees them at first, and the points from there in its axes.
  function centred(points) {
    const places = [];
    for (let i = 0; i < points.length; i += 3) places.push([...points.subarray(i, i + 3)]);
    const frame = axes(start);
    const seen = places.map((place) => frame.map((axis) => dot(axis, place)));
    const mean = [0, 1, 2].map((k) => {
      const values = seen.map((each) => each[k]);
      return (Math.min(...values) + Math.max(...values)) / 2;
    });
    return {
      middle: [0, 1, 2].map((k) => mean.reduce((sum, value, axis) => sum + value * frame[axis][k], 0)),
      offsets: seen.map((each) => each.map((value, axis) => value - mean[axis])),
    };
  }
  // Distance from which all of each motion is in view; one for all, so that sizes compare.
  function distance() {
    let far = 0.1;
    for (const { canvas, offsets } of scenes) {
      const aspect = canvas.clientWidth / canvas.clientHeight || 1;
      for (const [x, y, z] of offsets) {
        const wide = Math.max(Math.abs(x) / aspect, Math.abs(y));
        far = Math.max(far, z + wide / (SLOPE * MARGIN));
      }
    }
    return far;
  }
  function cameras(scene, far, aspect) {
    const [right, up, back] = axes(eye);
    const place = scene.middle.map((value, k) => value + far * back[k]);
    const view = [];
    for (let k = 0; k < 3; k++) view.push(right[k], up[k], back[k], 0);
    view.push(-dot(right, place), -dot(up, place), -dot(back, place), 1);
    const [near, end] = [0.02 * far, 12 * far];
    const projection = [1 / (SLOPE * aspect), 0, 0, 0, 0, 1 / SLOPE, 0, 0];
    projection.push(0, 0, -(end + near) / (end - near), -1, 0, 0, (-2 * end * near) / (end - near), 0);
    return { view: new Float32Array(view), projection: new Float32Array(projection) };
  }

  function use(name, matrices) {
    const program = programs[name];
    gl.useProgram(program);
    const at = (uniform) => gl.getUniformLocation(program, uniform);
    gl.uniformMatrix4fv(at("view"), false, matrices.view);
    gl.uniformMatrix4fv(at("projection"), false, matrices.projection);
    const feed = (attribute, source, size, stride = 0, offset = 0) => {
      const place = gl.getAttribLocation(program, attribute);
      gl.bindBuffer(gl.ARRAY_BUFFER, source);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, gl.FLOAT, false, stride, offset);
    };
    return { at, feed };
  }
  function drawBodies(scene, frame, matrices) {
    const { at, feed } = use("SOLID", matrices);
    const model = new Float32Array(16);
    model[15] = 1;
    for (const actor of scene.actors)
      for (const part of actor.parts) {
        const poses = actor.poses[part.link]; // the link's axes and place; one if it stands still
        if (!poses) continue; // a link that is hidden
        const first = poses.length > 12 ? 12 * frame : 0;
        for (let k = 0; k < 12; k++) model[4 * Math.floor(k / 3) + (k % 3)] = poses[first + k];
        gl.uniformMatrix4fv(at("model"), false, model);
        gl.uniform3fv(at("colour"), part.colour);
        feed("place", part.places, 3);
        feed("normal", part.normals, 3);
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, part.corners);
        gl.drawElements(gl.TRIANGLES, part.count, part.type, 0);
      }
  }
  function drawLines(scene, matrices, size, scale, opacity) {
    const ribbons = use("LINE", matrices);
    for (const line of scene.lines) {
      gl.uniform2fv(ribbons.at("size"), size);
      gl.uniform1f(ribbons.at("width"), 3 * scale);
      gl.uniform1f(ribbons.at("dash"), line.kind === "target" ? Math.min(0.02, line.length / 9) : 0);
      gl.uniform4fv(ribbons.at("colour"), [...INK[line.kind], opacity]);
      ["here", "there"].forEach((name, k) => ribbons.feed(name, line.corners, 3, 32, 12 * k));
      ribbons.feed("edge", line.corners, 2, 32, 24);
      gl.drawArrays(gl.TRIANGLES, 0, line.count);
    }
  }
  function drawDots(scene, frame, matrices, scale) {
    const dots = use("DOT", matrices);
    for (const line of scene.lines.filter((each) => each.dot)) {
      gl.uniform1f(dots.at("width"), (line.kind === "target" ? 9 : 13) * scale);
      gl.uniform4fv(dots.at("colour"), [...INK[line.kind], 1]);
      dots.feed("place", line.dot, 3, 0, 12 * frame);
      gl.drawArrays(gl.POINTS, 0, 1);
    }
  }
  function drawFloor(scene, matrices) {
    const { at, feed } = use("FLOOR", matrices);
    gl.uniform3fv(at("middle"), scene.middle);
    gl.uniform1f(at("reach"), scene.floor.reach);
    feed("place", scene.floor.lines, 3);
    gl.drawArrays(gl.LINES, 0, scene.floor.count);
  }

  function draw() {
    const scale = window.devicePixelRatio || 1;
    const frame = time.reduce((last, value, index) => (value <= now + 1e-6 ? index : last), 0);
    const far = distance() * eye.zoom;
    for (const scene of scenes) {
      const width = Math.max(1, Math.round(scene.canvas.clientWidth * scale));
      const height = Math.max(1, Math.round(scene.canvas.clientHeight * scale));
      if (scene.canvas.width !== width) scene.canvas.width = width;
      if (scene.canvas.height !== height) scene.canvas.height = height;
      if (sheet.width < width) sheet.width = width;
      if (sheet.height < height) sheet.height = height;
      gl.viewport(0, 0, width, height);
      gl.depthMask(true);
      gl.clearColor(...BACKGROUND, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.depthFunc(gl.LEQUAL);
      const matrices = cameras(scene, far, width / height);
      drawBodies(scene, frame, matrices);
      gl.depthMask(false); // floor and lines hide nothing
      drawFloor(scene, matrices);
      drawLines(scene, matrices, [width, height], scale, 1);
      gl.depthFunc(gl.GREATER); // what is behind the arm
      drawLines(scene, matrices, [width, height], scale, FAINT);
      gl.depthFunc(gl.ALWAYS); // dots are also seen inside the hand
      drawDots(scene, frame, matrices, scale);
      scene.canvas.getContext("2d").drawImage(sheet, 0, sheet.height - height, width, height, 0, 0, width, height);
    }
    slider.value = now;
    clock.textContent = now.toFixed(2) + " s";
  }

  let waiting = false;
  function redraw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      draw();
    });
  }
  function play(on) {
    playing = on && time.length > 1;
    button.textContent = playing ? "Pause" : "Play";
    if (!playing) return;
    let last = null;
    const end = time[time.length - 1];
    requestAnimationFrame(function step(stamp) {
      if (!playing) return;
      if (last !== null) now += (stamp - last) / 1000;
      if (now > end) now = time[0];
      last = stamp;
      draw();
      requestAnimationFrame(step);
    });
  }
  button.addEventListener("click", () => play(!playing));
  button.disabled = time.length < 2;
  slider.addEventListener("input", () => {
    play(false);
    now = Number(slider.value);
    redraw();
  });
  for (const canvas of canvases) {
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (!event.buttons) return;
      eye.turn += 0.008 * event.movementX;
      eye.tilt = Math.min(1.55, Math.max(-1.55, eye.tilt + 0.008 * event.movementY));
      redraw();
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      eye.zoom = Math.min(5, Math.max(0.15, eye.zoom * Math.exp(0.0012 * event.deltaY)));
      redraw();
    }, { passive: false });
    canvas.addEventListener("dblclick", () => {
      eye = { ...start };
      redraw();
    });
    new ResizeObserver(redraw).observe(canvas);
  }
  draw();
})();
