// What the viewer's pages use of three.js (MIT licence), bundled into drawing/web/three.min.js:
//
//   npm install three@0.187.0 esbuild@0.28.2     # in a folder outside the repository
//   NODE_PATH=node_modules node_modules/.bin/esbuild REPOSITORY/tools/three.mjs --bundle --minify \
//     --format=iife --global-name=THREE --outfile=REPOSITORY/src/geodesic_ocp/drawing/web/three.min.js
export {
  Box3, BufferAttribute, BufferGeometry, CatmullRomCurve3, Color, CylinderGeometry, DirectionalLight,
  DoubleSide, EdgesGeometry, FrontSide, GreaterDepth, Group, HemisphereLight, LineBasicMaterial,
  LineSegments, MathUtils, Mesh, MeshBasicMaterial, MeshLambertMaterial, MeshPhongMaterial, Object3D,
  PerspectiveCamera, PlaneGeometry, Quaternion, Raycaster, Scene, ShaderMaterial, ShadowMaterial,
  SphereGeometry, Spherical, SRGBColorSpace, TubeGeometry, Vector2, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
