// The machines: MuJoCo's geoms drawn by three.js, a part of one canvas for each simulation.

import * as THREE from "./vendor/three.module.js";

const [PLANE, HFIELD, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX] = [0, 1, 2, 3, 4, 5, 6];
const POSES = 9; // of the machine over its range, all of which the picture shows: chosen
const MARGIN = 1.06; // size of the picture, relative to what it shows: chosen
const TILES = 80; // along an edge of the floor
const SEAM = 2; // px between two machines
const PAD = 3; // px around the box of the moving parts that is redrawn: chosen
// Qualities of the picture, from the finest to the fastest: px of the canvas per px of the page, and shadows. Chosen.
const GRADES = [{ ratio: 2, shadows: true }, { ratio: 1, shadows: true }, { ratio: 1, shadows: false }];
const SLOW = 24; // frames a second, below which the next faster grade is used: chosen
const PATIENCE = 1.5; // s over which frames are counted: chosen
const STIFFNESS = 12; // of the spring by which a pointer pulls, in u_max per extent of the plant squared: chosen
// Arrow of u along a rail: length at the bound on u, and thickness, as shares of the plant's extent. Chosen.
const [PUSH, THIN] = [0.2, 0.018];
const REACH = 0.25; // of the plant's extent: a spring longer than that pulls no harder: chosen

function css(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

// Return whether WebGL is computed by the processor, as in a virtual machine without a GPU.
function software() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const about = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = about ? gl.getParameter(about.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

// Return the geometry of a geom; null for one that is not drawn.
function shape(model, i) {
  const [a, b, c] = model.geom_size.subarray(3 * i, 3 * i + 3);
  const upright = (geometry) => geometry.rotateX(Math.PI / 2); // three's cylinders stand along y
  switch (model.geom_type[i]) {
    case SPHERE: return new THREE.SphereGeometry(a, 32, 20);
    case CAPSULE: return upright(new THREE.CapsuleGeometry(a, 2 * b, 8, 24));
    case ELLIPSOID: return new THREE.SphereGeometry(1, 32, 20).scale(a, b, c);
    case CYLINDER: return upright(new THREE.CylinderGeometry(a, a, 2 * b, 40));
    case BOX: return new THREE.BoxGeometry(2 * a, 2 * b, 2 * c);
    case HFIELD: return heights(model, model.geom_dataid[i]);
    default: return null;
  }
}

// Return the geometry of a height field, with walls in front and behind.
function heights(model, id) {
  const [rx, ry, top, base] = model.hfield_size.subarray(4 * id, 4 * id + 4);
  const [rows, columns, first] = [model.hfield_nrow[id], model.hfield_ncol[id], model.hfield_adr[id]];
  const points = [];
  const faces = [];
  const sheet = (row) => { // a grid of corners: row(j) gives y and height of each column
    const from = points.length / 3;
    row.forEach(([y, z]) => {
      for (let k = 0; k < columns; k++) points.push(-rx + (2 * rx * k) / (columns - 1), y, z(k));
    });
    for (let j = 0; j + 1 < row.length; j++) {
      for (let k = 0; k + 1 < columns; k++) {
        const p = from + j * columns + k;
        faces.push(p, p + 1, p + columns, p + 1, p + columns + 1, p + columns);
      }
    }
  };
  const ground = (j) => (k) => top * model.hfield_data[first + j * columns + k];
  const y = (j) => -ry + (2 * ry * j) / (rows - 1);
  sheet(Array.from({ length: rows }, (_, j) => [y(j), ground(j)]));
  for (const j of [0, rows - 1]) sheet([[y(j), () => -base], [y(j), ground(j)]]);
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
  geometry.setIndex(faces);
  geometry.computeVertexNormals();
  return geometry;
}

// Return a texture of the floor's tiles, in the colours of the page.
function tiles() {
  const [canvas, size] = [document.createElement("canvas"), 128];
  canvas.width = canvas.height = size;
  const pen = canvas.getContext("2d");
  pen.fillStyle = css("--floor-line");
  pen.fillRect(0, 0, size, size);
  pen.fillStyle = css("--floor");
  pen.fillRect(1, 1, size - 2, size - 2);
  const texture = new THREE.CanvasTexture(canvas);
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.repeat.setScalar(TILES);
  texture.anisotropy = 4;
  texture.colorSpace = THREE.SRGBColorSpace;
  return texture;
}

// Set a matrix to a pose of MuJoCo: position i of p, and rotation i of m. Return it.
function pose(matrix, p, m, i) {
  const [a, b] = [3 * i, 9 * i];
  return matrix.set(
    m[b], m[b + 1], m[b + 2], p[a], m[b + 3], m[b + 4], m[b + 5], p[a + 1], m[b + 6], m[b + 7], m[b + 8], p[a + 2], 0, 0, 0, 1,
  );
}

// Return the matrix of geom i in the frame of its body.
function placeOnBody({ geom_pos, geom_quat }, i) {
  const [w, x, y, z] = geom_quat.subarray(4 * i, 4 * i + 4);
  const position = new THREE.Vector3(...geom_pos.subarray(3 * i, 3 * i + 3));
  return new THREE.Matrix4().compose(position, new THREE.Quaternion(x, y, z, w), new THREE.Vector3(1, 1, 1));
}

// Return one geometry with vertex colours, made of several parts, {geometry, colour} each.
function merged(parts) {
  const [position, normal, color, index] = [[], [], [], []];
  for (const { geometry, colour: { r, g, b } } of parts) {
    const before = position.length / 3;
    for (const vertex of geometry.index.array) index.push(before + vertex);
    for (const value of geometry.attributes.position.array) position.push(value);
    for (const value of geometry.attributes.normal.array) normal.push(value);
    for (let i = 0; i < geometry.attributes.position.count; i++) color.push(r, g, b);
  }
  const whole = new THREE.BufferGeometry();
  for (const [name, values] of Object.entries({ position, normal, color })) {
    whole.setAttribute(name, new THREE.Float32BufferAttribute(values, 3));
  }
  whole.setIndex(index);
  whole.computeBoundingBox();
  return whole;
}

// Return the mesh of a skin, such as a spring, whose vertices `bend` moves. That is done here and not in a shader, because
// without a GPU a shader is slower.
function skinned({ vertices, faces, weights, bones, rgba: [r, g, b] }) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(vertices, 3).setUsage(THREE.DynamicDrawUsage));
  geometry.setIndex(faces);
  geometry.computeVertexNormals(); // once, because the bodies of a skin do not turn
  const colour = new THREE.Color().setRGB(r, g, b, THREE.SRGBColorSpace);
  const mesh = new THREE.Mesh(geometry, new THREE.MeshPhongMaterial({ color: colour, shininess: 60, specular: 0x333333 }));
  mesh.userData.bones = bones.map(({ position, quaternion: [w, x, y, z] }, k) => {
    const bind = new THREE.Matrix4().compose(new THREE.Vector3(...position), new THREE.Quaternion(x, y, z, w), new THREE.Vector3(1, 1, 1));
    const local = new THREE.Float32BufferAttribute(vertices, 3).applyMatrix4(bind.invert()).array; // in the body's frame
    return { local, weights: Float32Array.from(weights.filter((_, i) => i % bones.length === k)) };
  });
  mesh.frustumCulled = false;
  return mesh;
}

// Move a skin's vertices with its bodies: each is the weighted mean of its places on them.
function bend({ geometry, userData: { bones, bodies } }, xpos, xmat) {
  const { position } = geometry.attributes;
  const at = position.array.fill(0);
  bones.forEach(({ local, weights }, k) => {
    const p = xpos.subarray(3 * bodies[k], 3 * bodies[k] + 3);
    const m = xmat.subarray(9 * bodies[k], 9 * bodies[k] + 9);
    for (let i = 0; i < weights.length; i++) {
      const [x, y, z] = [local[3 * i], local[3 * i + 1], local[3 * i + 2]];
      for (let row = 0; row < 3; row++) {
        at[3 * i + row] += weights[i] * (p[row] + m[3 * row] * x + m[3 * row + 1] * y + m[3 * row + 2] * z);
      }
    }
  });
  position.needsUpdate = true;
}

const noBounds = () => ({ left: Infinity, right: -Infinity, bottom: Infinity, top: -Infinity });
const point = new THREE.Vector3();

// Return the eight corners of a geometry's box, as an array of x, y, z of each.
function cornersOf({ boundingBox: { min, max } }) {
  return Array.from({ length: 8 }, (_, c) => [c & 1 ? max.x : min.x, c & 2 ? max.y : min.y, c & 4 ? max.z : min.z]).flat();
}

// Extend bounds so that they contain points, given as x, y, z of each. A point is multiplied by `matrix`, and `flat` returns
// its x and y.
function spread(bounds, points, matrix, flat) {
  for (let i = 0; i < points.length; i += 3) {
    const { x, y } = flat(point.set(points[i], points[i + 1], points[i + 2]).applyMatrix4(matrix));
    bounds.left = Math.min(bounds.left, x);
    bounds.right = Math.max(bounds.right, x);
    bounds.bottom = Math.min(bounds.bottom, y);
    bounds.top = Math.max(bounds.top, y);
  }
}

// One machine: the scene of a simulation.
class Machine {
  constructor(simulation, colour) {
    this.simulation = simulation;
    this.scene = new THREE.Scene();
    this.meshes = [];
    const { model, data, mujoco } = simulation;
    const accent = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MATERIAL.value, "accent");
    const bodies = new Map(); // the geoms of a body are one mesh, and so are all that do not move: few meshes draw fast
    for (let i = 0; i < model.ngeom; i++) {
      const material = model.geom_matid[i];
      const geometry = shape(model, i);
      const source = material >= 0 ? model.mat_rgba : model.geom_rgba;
      const at = 4 * (material >= 0 ? material : i);
      if (!geometry || source[at + 3] === 0) continue;
      const [r, g, b] = source.subarray(at, at + 3);
      const body = model.body_weldid[model.geom_bodyid[i]] === 0 ? 0 : model.geom_bodyid[i];
      const flat = model.geom_type[i] === HFIELD;
      const key = `${body} ${flat}`;
      if (!bodies.has(key)) bodies.set(key, { body, flat, parts: [] });
      bodies.get(key).parts.push({
        geometry: geometry.applyMatrix4(body ? placeOnBody(model, i) : pose(new THREE.Matrix4(), data.geom_xpos, data.geom_xmat, i)),
        colour: material === accent ? new THREE.Color(colour) : new THREE.Color().setRGB(r, g, b, THREE.SRGBColorSpace),
      });
    }
    for (const { body, flat, parts } of bodies.values()) {
      const mesh = new THREE.Mesh(merged(parts), new THREE.MeshPhongMaterial({
        vertexColors: true, shininess: 60, specular: flat ? 0x111111 : 0x333333, side: flat ? THREE.DoubleSide : THREE.FrontSide,
      }));
      mesh.castShadow = !flat;
      mesh.receiveShadow = true;
      mesh.matrixAutoUpdate = false;
      mesh.userData = { body, corners: cornersOf(mesh.geometry) };
      this.scene.add(mesh);
      this.meshes.push(mesh);
    }
    this.skins = simulation.plant.skins.map((skin) => {
      const mesh = skinned(skin);
      mesh.castShadow = mesh.receiveShadow = true;
      mesh.userData.bodies = skin.bones.map(({ body }) => mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY.value, body));
      this.scene.add(mesh);
      return mesh;
    });
    this.moving = this.meshes.filter((mesh) => mesh.userData.body !== 0);
    this.arrow = new THREE.ArrowHelper(new THREE.Vector3(0, 0, 1), new THREE.Vector3(), 1, css("--focus"), 0.1, 0.05);
    this.arrow.visible = false;
    this.light();
    this.scene.add(this.arrow);
    this.joint = model.jnt_dofadr.indexOf(simulation.plant.channels[0].dof);
    const geoms = Array.from(model.geom_bodyid, (body, i) => (body === model.jnt_bodyid[this.joint] ? i : -1)).filter((i) => i >= 0);
    this.handle = geoms.find((i) => model.geom_matid[i] === accent) ?? geoms[0]; // what bears the arrow of u
    this.u = 0; // mean of the last frame, of the bound on u
    const material = new THREE.MeshPhongMaterial({ color: colour, shininess: 60, specular: 0x333333 });
    this.force = new THREE.Group().add(
      new THREE.Mesh(new THREE.CylinderGeometry(1, 1, 1, 16).translate(0, 0.5, 0), material),
      new THREE.Mesh(new THREE.ConeGeometry(2.2, 1, 20).translate(0, 0.5, 0), material),
    );
    this.scene.add(this.force);
    this.place();
  }

  // Free the memory of the graphics card.
  dispose() {
    this.scene.traverse((each) => {
      each.geometry?.dispose();
      each.material?.dispose();
    });
    for (const material of this.floors) {
      material.map?.dispose();
      material.dispose();
    }
  }

  // Add floor, tiles and lights to the scene, in the colours of the page.
  light() {
    const { scene } = this;
    const { extent, center } = this.simulation.plant;
    // the second material is for grades without shadows: tiles and light take most of a picture's time without a GPU
    this.floors = [new THREE.MeshLambertMaterial({ map: tiles() }), new THREE.MeshBasicMaterial({ color: css("--floor") })];
    const floor = this.floor = new THREE.Mesh(new THREE.PlaneGeometry(1, 1), this.floors[0]);
    const tile = extent > 1 ? 0.5 : 0.1; // m
    floor.scale.setScalar(TILES * tile);
    floor.receiveShadow = true;
    const key = new THREE.DirectionalLight(0xffffff, 2.0);
    const target = new THREE.Vector3(...center);
    key.position.set(-0.35, -0.55, 0.8).multiplyScalar(3 * extent).add(target);
    key.target.position.copy(target);
    key.castShadow = true;
    key.shadow.mapSize.set(1024, 1024);
    Object.assign(key.shadow.camera, { left: -extent, right: extent, top: extent, bottom: -extent, near: 0.01, far: 8 * extent });
    key.shadow.bias = -0.0005;
    const fill = new THREE.DirectionalLight(0xdfe6ff, 0.6);
    fill.position.set(0.45, -0.8, 0.35);
    scene.add(floor, key, key.target, fill, new THREE.HemisphereLight(0xffffff, 0xc8c8d0, 1.9));
    scene.background = new THREE.Color(css("--stage"));
    scene.fog = new THREE.Fog(css("--stage"), 5 * extent, 12 * extent);
  }

  // Put meshes and skins where MuJoCo's bodies are.
  place() {
    const { xpos, xmat } = this.simulation.data;
    for (const mesh of this.moving) {
      pose(mesh.matrix, xpos, xmat, mesh.userData.body);
      mesh.matrixWorldNeedsUpdate = true;
    }
    for (const skin of this.skins) bend(skin, xpos, xmat);
  }

  // Point the arrow of u, as in films: along a pendulum's arc beyond the bob, or along the rail above the cart.
  pointForce() {
    const { force, joint, handle, simulation: { model, data, plant: { extent, channels }, facts: { arrow } } } = this;
    const vector = (array, i) => new THREE.Vector3(...array.subarray(3 * i, 3 * i + 3));
    const [axis, foot] = [vector(data.xaxis, joint), vector(data.geom_xpos, handle)];
    const share = Math.min(Math.max(this.u, -1), 1);
    let [along, out, reach, width] = [axis, new THREE.Vector3(0, 0, 1), PUSH * extent, THIN * extent];
    if (channels[0].unit === "rad") {
      out = foot.clone().sub(vector(data.xanchor, joint));
      const length = out.length();
      out.normalize();
      along = axis.clone().cross(out);
      const radius = model.geom_rbound[handle];
      [reach, width] = [arrow.arc * length, arrow.of_radius * radius + arrow.of_length * Math.min(length, arrow.long)];
      foot.addScaledVector(out, radius + arrow.off_arc * width);
    } else {
      const [, depth, height] = model.geom_aabb.subarray(6 * handle + 3, 6 * handle + 6);
      foot.addScaledVector(out, height + arrow.off_rail * width);
      if (channels.length > 1) foot.y -= depth + width; // in front of what the cart carries
    }
    const length = reach * Math.abs(share);
    force.visible = Math.abs(share) > arrow.shortest && along.lengthSq() > 0.5;
    if (!force.visible) return;
    const head = Math.min(3 * width, length / 2);
    const radius = Math.min(width, head) / 2;
    const [shaft, tip] = force.children;
    shaft.scale.set(radius, length - head, radius);
    tip.scale.set(radius, head, radius);
    tip.position.y = length - head;
    force.position.copy(foot);
    force.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.multiplyScalar(Math.sign(share)));
    force.updateMatrixWorld();
  }

  // Return the bounds, from -1 to 1 across the camera's picture, of what moves.
  movingBounds(camera) {
    const seen = noBounds();
    const toPicture = camera.projectionMatrix.clone().multiply(camera.matrixWorldInverse);
    const matrix = new THREE.Matrix4();
    const same = (point) => point;
    for (const mesh of this.moving) spread(seen, mesh.userData.corners, matrix.multiplyMatrices(toPicture, mesh.matrix), same);
    if (this.force.visible) spread(seen, cornersOf({ boundingBox: new THREE.Box3().setFromObject(this.force) }), toPicture, same);
    for (const skin of this.skins) spread(seen, skin.geometry.attributes.position.array, toPicture, same);
    return seen;
  }

  // Return the bounds of x/z and y/z, in the camera's frame, of the machine in POSES over its range, with the arrows of the
  // largest u.
  bounds(camera) {
    const { simulation: { mujoco, model, data, plant, s } } = this;
    const [kept, u] = [data.qpos.slice(), this.u];
    const toCamera = camera.matrixWorld.clone().invert();
    const toTangents = (point) => point.multiplyScalar(-1 / point.z);
    const seen = noBounds();
    for (let k = 0; k < POSES; k++) {
      plant.channels.forEach((channel, i) => {
        const reach = channel.unit === "rad" ? Math.PI : Math.abs(s.x0[i]);
        data.qpos[channel.qpos] = reach * (-1 + (2 * k) / (POSES - 1));
      });
      mujoco.mj_kinematics(model, data);
      this.place();
      for (const mesh of k === 0 ? this.meshes : this.moving) {
        spread(seen, mesh.geometry.attributes.position.array, toCamera.clone().multiply(mesh.matrix), toTangents);
      }
      for (this.u of [-1, 1]) {
        this.pointForce();
        for (const part of this.force.visible ? this.force.children : []) {
          spread(seen, part.geometry.attributes.position.array, toCamera.clone().multiply(part.matrixWorld), toTangents);
        }
      }
    }
    data.qpos.set(kept);
    this.u = u;
    mujoco.mj_kinematics(model, data);
    this.place();
    return seen;
  }
}

export class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.slow = software();
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !this.slow, preserveDrawingBuffer: this.slow });
    canvas.addEventListener("webglcontextrestored", () => this.drawAll());
    this.setGrade(this.slow ? 2 : 0);
    this.renderer.setClearAlpha(0); // the page shows between two machines
    this.renderer.setScissorTest(true);
    this.camera = new THREE.PerspectiveCamera();
    this.machines = [];
    this.ray = new THREE.Raycaster();
    this.held = null; // what the pointer has grabbed
  }

  setGrade(grade) {
    this.grade = grade;
    this.renderer.shadowMap.enabled = GRADES[grade].shadows;
    this.since = null; // time of the first frame that is counted, ms
    this.frames = 0;
    this.furnish();
  }

  // Give the machines' floors and materials the look of the grade.
  furnish() {
    for (const machine of this.machines ?? []) {
      machine.floor.material = machine.floors[GRADES[this.grade].shadows ? 0 : 1];
      machine.scene.traverse((each) => each.material && (each.material.needsUpdate = true));
    }
    this.drawAll();
  }

  // Redraw the whole picture in the next frame.
  drawAll() {
    for (const machine of this.machines ?? []) machine.drawn = null;
  }

  // Use the next faster grade if the frames come too slowly; `now` in ms.
  watch(now) {
    this.since ??= now;
    this.frames += 1;
    const seconds = (now - this.since) / 1000;
    if (seconds < PATIENCE) return;
    if (this.frames / seconds < SLOW && this.grade < GRADES.length - 1) this.setGrade(this.grade + 1);
    [this.since, this.frames] = [now, 0];
  }

  // Show simulations, with their colours.
  show(simulations, colours) {
    for (const machine of this.machines) machine.dispose();
    this.renderer.setScissorTest(false);
    this.renderer.clear(); // otherwise the previous machines stay visible between two parts
    this.renderer.setScissorTest(true);
    this.machines = simulations.map((simulation, i) => new Machine(simulation, colours[i]));
    this.furnish();
    this.beside = simulations[0].plant.beside;
    const { mujoco, model, data } = simulations[0];
    const look = Math.max(0, mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA.value, "look"));
    mujoco.mj_forward(model, data);
    const m = data.cam_xmat.slice(9 * look, 9 * look + 9);
    const p = data.cam_xpos.slice(3 * look, 3 * look + 3);
    this.camera.matrixAutoUpdate = false;
    this.camera.matrix.set(m[0], m[1], m[2], p[0], m[3], m[4], m[5], p[1], m[6], m[7], m[8], p[2], 0, 0, 0, 1);
    this.camera.updateMatrixWorld(true);
    this.camera.matrixWorld.copy(this.camera.matrix);
    this.camera.matrixWorldInverse.copy(this.camera.matrix).invert();
    this.seen = this.machines[0].bounds(this.camera);
    // far enough from the camera that a depth buffer of 16 bits tells a mark from what it lies on
    this.near = new THREE.Vector3(...p).distanceTo(new THREE.Vector3(...simulations[0].plant.center)) / 8;
  }

  // Replace the simulations that the machines show.
  swap(simulations) {
    this.machines.forEach((machine, i) => (machine.simulation = simulations[i]));
  }

  // Return the part of the canvas that each machine has, in px from the upper left corner.
  parts() {
    const [width, height, n] = [this.canvas.clientWidth, this.canvas.clientHeight, this.machines.length];
    const seams = SEAM * (n - 1);
    const [w, h] = this.beside ? [(width - seams) / n, height] : [width, (height - seams) / n];
    return this.machines.map((_, i) => ({ x: this.beside ? i * (w + SEAM) : 0, y: this.beside ? 0 : i * (h + SEAM), width: w, height: h }));
  }

  // Set the camera's projection so that the machine fills a part of the canvas.
  open(part) {
    const { left, right, bottom, top } = this.seen;
    let [halfX, halfY] = [((right - left) / 2) * MARGIN, ((top - bottom) / 2) * MARGIN];
    const aspect = part.width / part.height;
    [halfX, halfY] = [Math.max(halfX, halfY * aspect), Math.max(halfY, halfX / aspect)];
    const [x, y, near] = [(left + right) / 2, (bottom + top) / 2, this.near];
    const { camera } = this;
    camera.projectionMatrix.makePerspective(
      near * (x - halfX), near * (x + halfX), near * (y + halfY), near * (y - halfY), near, 5000 * near,
    );
    camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
  }

  draw() {
    const { renderer, canvas } = this;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const ratio = Math.min(GRADES[this.grade].ratio, window.devicePixelRatio || 1);
    const size = renderer.getSize(new THREE.Vector2());
    if (size.x !== width || size.y !== height || renderer.getPixelRatio() !== ratio) {
      renderer.setPixelRatio(ratio);
      renderer.setSize(width, height, false);
      this.drawAll();
    }
    this.parts().forEach((part, i) => {
      const machine = this.machines[i];
      machine.place();
      machine.pointForce();
      this.pointArrow(machine);
      this.open(part);
      const box = this.changed(machine, part);
      if (box === null) return;
      renderer.setViewport(part.x, height - part.y - part.height, part.width, part.height);
      renderer.setScissor(box.x, height - box.y - box.height, box.width, box.height);
      renderer.render(machine.scene, this.camera);
    });
  }

  // Return the box of a machine's part of the canvas that must be redrawn, in px; null if nothing moved. Without a GPU,
  // where every pixel takes time, it contains the moving parts where they are and where they were. With a GPU it is the
  // whole part, because shadows move as well.
  changed(machine, part) {
    const { simulation: { step }, arrow: { visible: pulled }, drawn } = machine;
    if (drawn?.step === step && !drawn.pulled && !pulled) return null;
    const inBoxes = this.slow && !GRADES[this.grade].shadows; // a new grade sets `drawn` to null
    const box = inBoxes ? this.boxOf(machine, part) : null;
    machine.drawn = { step, pulled, box };
    if (!box || !drawn || drawn.pulled || pulled) return part;
    const x = Math.max(part.x, Math.floor(Math.min(box.left, drawn.box.left)));
    const y = Math.max(part.y, Math.floor(Math.min(box.top, drawn.box.top)));
    const width = Math.min(part.x + part.width, Math.ceil(Math.max(box.right, drawn.box.right))) - x;
    const height = Math.min(part.y + part.height, Math.ceil(Math.max(box.bottom, drawn.box.bottom))) - y;
    return width > 0 && height > 0 ? { x, y, width, height } : null;
  }

  // Return the box of what moves in a machine's part of the canvas, in px.
  boxOf(machine, part) {
    const { left, right, bottom, top } = machine.movingBounds(this.camera);
    return {
      left: part.x + ((left + 1) / 2) * part.width - PAD, right: part.x + ((right + 1) / 2) * part.width + PAD,
      top: part.y + ((1 - top) / 2) * part.height - PAD, bottom: part.y + ((1 - bottom) / 2) * part.height + PAD,
    };
  }

  // Set the ray of a pointer. Return the index of the machine under it, or of the grabbed one; null for none.
  aim(event) {
    const box = this.canvas.getBoundingClientRect();
    const [px, py] = [event.clientX - box.left, event.clientY - box.top];
    const parts = this.parts();
    const i = this.held?.index ?? parts.findIndex(({ x, y, width, height }) => px >= x && px < x + width && py >= y && py < y + height);
    if (i < 0) return null;
    const part = parts[i];
    this.open(part);
    const at = new THREE.Vector2((2 * (px - part.x)) / part.width - 1, 1 - (2 * (py - part.y)) / part.height);
    this.ray.setFromCamera(at, this.camera);
    return i;
  }

  // Return where a geom of machine i is on the canvas, px.
  onScreen(i, name) {
    const { mujoco, model, data } = this.machines[i].simulation;
    const geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM.value, name);
    const part = this.parts()[i];
    this.open(part);
    const at = new THREE.Vector3(...data.geom_xpos.subarray(3 * geom, 3 * geom + 3)).project(this.camera);
    return [part.x + ((at.x + 1) / 2) * part.width, part.y + ((1 - at.y) / 2) * part.height];
  }

  // Grab the moving body under the pointer. Return whether there is one.
  grab(event) {
    const index = this.aim(event);
    if (index === null) return false;
    const machine = this.machines[index];
    const [hit] = this.ray.intersectObjects(machine.moving, false);
    if (!hit) return false;
    const mesh = hit.object;
    const local = hit.point.clone().applyMatrix4(mesh.matrix.clone().invert());
    this.held = { index, mesh, local, target: hit.point.clone(), depth: hit.point.clone() };
    return true;
  }

  // Move the target of the grabbed point to the pointer, in the plane that faces the camera.
  drag(event) {
    if (!this.held || this.aim(event) === null) return;
    const normal = new THREE.Vector3().setFromMatrixColumn(this.camera.matrixWorld, 2);
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(normal, this.held.depth);
    this.ray.ray.intersectPlane(plane, this.held.target);
  }

  release() {
    if (this.held) this.machines[this.held.index].arrow.visible = false;
    this.held = null;
  }

  // Return the generalised force by which the pointer pulls each simulation, through a spring to the grabbed point.
  pulls() {
    const forces = this.machines.map(({ simulation }) => new Float64Array(simulation.model.nv));
    if (!this.held) return forces;
    const { index, mesh, local, target } = this.held;
    const { model, data, s, plant: { extent } } = this.machines[index].simulation;
    const point = local.clone().applyMatrix4(mesh.matrix);
    const pull = target.clone().sub(point);
    pull.multiplyScalar((STIFFNESS * s.u_max) / extent ** 2 / Math.max(1, pull.length() / (REACH * extent)) * Math.min(1, extent));
    for (let body = mesh.userData.body; body > 0; body = model.body_parentid[body]) {
      for (let j = model.body_jntadr[body], n = model.body_jntnum[body]; n > 0; j++, n--) {
        const axis = new THREE.Vector3(...data.xaxis.subarray(3 * j, 3 * j + 3));
        const arm = point.clone().sub(new THREE.Vector3(...data.xanchor.subarray(3 * j, 3 * j + 3)));
        const hinge = model.jnt_type[j] === 3;
        forces[index][model.jnt_dofadr[j]] += hinge ? arm.cross(pull).dot(axis) : pull.dot(axis);
      }
    }
    return forces;
  }

  // Draw the arrow from the grabbed point of a machine to the pointer, or hide it.
  pointArrow(machine) {
    const { arrow } = machine;
    const held = this.held && this.machines[this.held.index] === machine ? this.held : null;
    arrow.visible = held !== null;
    if (!held) return;
    const from = held.local.clone().applyMatrix4(held.mesh.matrix);
    const to = held.target.clone().sub(from);
    const length = Math.max(to.length(), 1e-3);
    arrow.position.copy(from);
    arrow.setDirection(to.normalize());
    const head = Math.min(length / 2, machine.simulation.plant.extent / 15);
    arrow.setLength(length, head, head / 2);
  }
}
