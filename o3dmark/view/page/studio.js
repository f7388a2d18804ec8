// Light and surfaces: the same studio as in o3dmark's pictures (shading.py), without the shadows of nearby parts.
// All vectors are in the camera's axes: right, up, to the eye.
import { Color, DataTexture, DoubleSide, LinearFilter, ShaderMaterial, Vector2, Vector3 } from "three";

export const LOOKS = { clay: 0, gloss: 1, zebra: 2, worn: 3, displacement: 4, saliency: 4 };

const VERTEX = `
attribute vec3 tint;
attribute float quantity;
uniform float diameter;  // of a point, in pixels at distance one
varying vec3 vNormal, vToEye, vTint;
varying vec2 vUv;
varying float vQuantity;
void main() {
  vec4 place = modelViewMatrix * vec4(position, 1.0);
  vNormal = normalMatrix * normal;
  vToEye = -place.xyz;
  vTint = tint;
  vUv = uv;
  vQuantity = quantity;
  gl_Position = projectionMatrix * place;
  gl_PointSize = diameter / -place.z;
}`;

const FRAGMENT = `
uniform int look;
uniform bool isPoint, hasPicture, hasTint, hasQuantity;
uniform sampler2D picture, ramp;
uniform vec2 limits, clay, varnish, stripeLight;
uniform vec3 material, key, keyColour, fill, fillColour, skyColour, groundColour;
uniform float gamma, stripes, edge;
varying vec3 vNormal, vToEye, vTint;
varying vec2 vUv;
varying float vQuantity;
const float PI = 3.141592653589793;

vec3 colour() {
  if (look == 3 && hasPicture) return texture2D(picture, vUv).rgb;
  if (look == 3 && hasTint) return vTint;
  if (look == 4 && hasQuantity) {
    float t = clamp((vQuantity - limits.x) / (limits.y - limits.x), 0.0, 1.0);
    return texture2D(ramp, vec2((0.5 + 255.0 * t) / 256.0, 0.5)).rgb;
  }
  return material;
}

vec3 zebra(vec3 n, vec3 toEye) {
  vec3 reflected = 2.0 * dot(n, toEye) * n - toEye;
  float height = asin(clamp(reflected.y, -1.0, 1.0)) / PI + 0.5;
  float wave = sin(2.0 * PI * stripes * height);
  float soft = max(sin(PI * edge), fwidth(wave));
  return vec3(mix(stripeLight.x, stripeLight.y, 0.5 + 0.5 * wave / max(abs(wave), soft)));
}

vec3 shade(vec3 n, vec3 toEye, vec3 rgb, vec2 gloss) {
  vec3 ambient = mix(groundColour, skyColour, 0.5 + 0.5 * n.y);
  vec3 light = max(dot(n, key), 0.0) * keyColour + max(dot(n, fill), 0.0) * fillColour + ambient;
  float highlight = gloss.x * pow(max(dot(n, normalize(toEye + key)), 0.0), gloss.y);
  return light * pow(rgb, vec3(gamma)) + highlight;
}

void main() {
  if (isPoint && length(gl_PointCoord - 0.5) > 0.5) discard;
  vec3 toEye = normalize(vToEye);
  vec3 n = normalize(vNormal);
  if (isPoint ? dot(n, toEye) < 0.0 : !gl_FrontFacing) n = -n;
  vec3 light = look == 2 ? zebra(n, toEye) : shade(n, toEye, colour(), look == 1 ? varnish : clay);
  gl_FragColor = vec4(pow(clamp(light, 0.0, 1.0), vec3(1.0 / gamma)), 1.0);
}`;

/** A colormap of 256 colours as a texture. */
export function rampTexture(rgba) {
  const texture = new DataTexture(rgba, 256, 1);
  texture.minFilter = texture.magFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

/** The material of a mesh, or of points. */
export function surfaceMaterial(studio, isPoint) {
  const values = {
    ...Object.fromEntries(["gamma", "stripes", "edge"].map((name) => [name, studio[name]])),
    ...Object.fromEntries(["clay", "varnish", "stripeLight"].map((name) => [name, new Vector2(...studio[name])])),
    ...Object.fromEntries(
      ["material", "key", "keyColour", "fill", "fillColour", "skyColour", "groundColour"].map((name) => [
        name,
        new Vector3(...studio[name]),
      ]),
    ),
    ...{ look: 0, isPoint, hasPicture: false, hasTint: false, hasQuantity: false },
    ...{ picture: null, ramp: null, limits: new Vector2(0, 1), diameter: 1 },
  };
  const uniforms = Object.fromEntries(Object.entries(values).map(([name, value]) => [name, { value }]));
  return new ShaderMaterial({
    uniforms,
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    side: DoubleSide,
    polygonOffset: true, // wires lie in front
    polygonOffsetFactor: 1,
    polygonOffsetUnits: 1,
  });
}

/** The ink of wires: dark, and clear enough to see the surface through. */
export const WIRE = { color: new Color(0x10202c), transparent: true, opacity: 0.35 };
