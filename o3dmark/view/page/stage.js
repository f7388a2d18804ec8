// All shapes under one camera, each in its own part of one canvas: turning one turns all.
import { Group, Matrix4, OrbitControls, PerspectiveCamera, Scene, Spherical, Vector3, WebGLRenderer } from "three";

const STEP = Math.PI / 36; // that an arrow key turns
const ZOOM = 1.1; // that a key or a notch of the wheel magnifies
const MARGIN = 1.08; // left around the largest shape
const DEPTH = 0.5; // half a bounding box, whose diagonal is the unit

const radians = (degrees) => (Math.PI / 180) * degrees;

/** How far a sphere reaches from the origin. */
const reach = ({ center, radius }) => center.length() + radius;

/** How far shapes reach from the middle of the picture, up at the start and across at any azimuth, as tangents. */
function extent(shapes, upright, { azimuth, elevation }, distance) {
  const back = new Vector3().setFromSphericalCoords(1, radians(90 - elevation), radians(azimuth));
  const up = new Vector3().setFromSphericalCoords(1, radians(-elevation), radians(azimuth));
  const [point, found] = [new Vector3(), { up: 1e-3, across: 1e-3 }];
  for (const { base } of shapes) {
    for (let at = 0; at < base.length; at += 3) {
      point.fromArray(base, at).applyMatrix4(upright);
      const [high, wide] = [Math.abs(point.dot(up)), Math.hypot(point.x, point.z)];
      found.up = Math.max(found.up, high / (distance - point.dot(back)));
      found.across = Math.max(found.across, wide / Math.sqrt(distance ** 2 - wide ** 2));
    }
  }
  return found;
}

export class Stage {
  /** places: the element of each shape, within `element`, whose size says where it is drawn. */
  constructor(element, canvas, places, shapes, scene) {
    Object.assign(this, { element, canvas, places, shapes, start: scene.camera });
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setScissorTest(true);
    const m = scene.world;
    const upright = new Matrix4().set(m[0], m[1], m[2], 0, m[3], m[4], m[5], 0, m[6], m[7], m[8], 0, 0, 0, 0, 1);
    this.scenes = shapes.map((shape) => {
      const turned = new Group();
      turned.applyMatrix4(upright);
      turned.add(shape.object);
      return new Scene().add(turned);
    });
    this.radius = Math.max(...shapes.map(({ geometry }) => reach(geometry.boundingSphere)));
    this.camera = new PerspectiveCamera(scene.fieldOfView, 1, 0.01, 100);
    this.controls = new OrbitControls(this.camera, element);
    this.controls.zoomSpeed = 1.5;
    this.controls.addEventListener("change", () => this.draw());
    element.addEventListener("keydown", (event) => this.#key(event));
    new ResizeObserver(() => this.draw()).observe(element);
    this.distance = DEPTH / Math.sin(radians(scene.fieldOfView / 2));
    this.extent = extent(shapes, upright, this.start, this.distance);
    this.reset();
  }

  /** Look from where the page began. */
  reset() {
    const [phi, theta] = [radians(90 - this.start.elevation), radians(this.start.azimuth)];
    this.controls.target.set(0, 0, 0);
    this.#from(new Spherical(this.distance / this.start.zoom, phi, theta));
  }

  /** Turn by angles to the right and up, and magnify. */
  turn(right, up, zoom = 1) {
    const from = new Spherical().setFromVector3(this.camera.position.clone().sub(this.controls.target));
    this.#from(new Spherical(from.radius / zoom, from.phi - up, from.theta + right));
  }

  #from(spherical) {
    spherical.makeSafe();
    this.camera.position.setFromSpherical(spherical).add(this.controls.target);
    this.controls.update();
    this.draw();
  }

  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const does = {
      ArrowLeft: () => this.turn(-STEP, 0),
      ArrowRight: () => this.turn(STEP, 0),
      ArrowUp: () => this.turn(0, STEP),
      ArrowDown: () => this.turn(0, -STEP),
      "+": () => this.turn(0, 0, ZOOM),
      "=": () => this.turn(0, 0, ZOOM),
      "-": () => this.turn(0, 0, 1 / ZOOM),
      Home: () => this.reset(),
    }[event.key];
    if (!does) return;
    event.preventDefault();
    does();
  }

  /** Draw soon; as often as asked, once a frame. */
  draw() {
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = null;
      this.#render();
    });
  }

  #render() {
    const box = this.element.getBoundingClientRect();
    this.renderer.setSize(box.width, box.height, false);
    this.renderer.setScissor(0, 0, box.width, box.height);
    this.renderer.clear();
    this.places.forEach((place, number) => {
      const { left, bottom, width, height } = place.getBoundingClientRect();
      if (!width || !height) return;
      const area = [left - box.left, box.bottom - bottom, width, height];
      this.renderer.setViewport(...area);
      this.renderer.setScissor(...area);
      this.#fit(width, height);
      this.shapes[number].prepare((this.renderer.getPixelRatio() * height) / (2 * Math.tan(radians(this.camera.fov / 2))));
      this.renderer.render(this.scenes[number], this.camera);
    });
    this.element.dispatchEvent(new CustomEvent("drawn"));
  }

  /** A field of view that all shapes fit in from where the page began, at any azimuth. */
  #fit(width, height) {
    const half = MARGIN * Math.max(this.extent.up, (this.extent.across * height) / width);
    this.camera.fov = (360 / Math.PI) * Math.atan(half);
    this.camera.aspect = width / height;
    const distance = this.camera.position.distanceTo(this.controls.target);
    this.camera.near = Math.max(distance - 4 * this.radius, distance / 500);
    this.camera.far = distance + 4 * this.radius;
    this.camera.updateProjectionMatrix();
  }
}
