// The 3-D view. Draws when something changed, never in a loop: a dashboard may stay open for days.

import {
    BufferAttribute,
    BufferGeometry,
    Color,
    DirectionalLight,
    DoubleSide,
    Fog,
    Group,
    HemisphereLight,
    Mesh as Drawn,
    MeshBasicMaterial,
    MeshLambertMaterial,
    PerspectiveCamera,
    Plane,
    Points,
    PointsMaterial,
    Scene as Stage,
    SRGBColorSpace,
    Vector3,
    WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';

import { colour } from '../theme';
import { colourAt, median, type Measure } from './colours';
import { boxOf, cutFrom, cutOf, TetFaces, tetEdge, tetQuality, triangleEdge, triangleQuality, type Clip, type Mesh, type TetMesh } from './mesh';

export type Content =
    | { kind: 'surface'; mesh: Mesh }
    | { kind: 'particles'; mesh: Mesh; ghost: Mesh | null }
    | { kind: 'tets'; mesh: TetMesh };

interface Values {
    quality: Float32Array;
    edge: Float32Array;
}

const turnStep = Math.PI / 24;
const lineOpacity = 0.2;
/** Corners whose triangle leans further than this from the mean stay sharp, as those of a box do. */
const cosOfSharp = Math.cos((40 * Math.PI) / 180);

export class Scene {
    private readonly renderer: WebGLRenderer;
    private readonly stage = new Stage();
    private readonly camera = new PerspectiveCamera(32, 1, 0.01, 1000);
    private readonly controls: OrbitControls;
    private readonly contents = new Group();
    private readonly fog = new Fog(0);
    private readonly plane = new Plane(new Vector3(-1, 0, 0), 0);
    private content: Content | null = null;
    private faces: TetFaces | null = null;
    /** Triangles of the whole boundary of the tets. */
    private whole: Uint32Array | null = null;
    private values: Values | null = null;
    private measure: Measure = 'quality';
    private clip: Clip = { axis: 1, share: 0 };
    private hasEdges = true;
    private hasRoundings = false;
    /** What edge lengths are compared with, model units. */
    private reference: number | null = null;
    private radius = 1;
    /** Median length, model units. */
    private middleEdge = 1;
    private lines: MeshBasicMaterial | null = null;
    private isFitted = false;
    /** Whether somebody chose a view: that one stays. */
    private isTurned = false;
    private frame = 0;

    constructor(canvas: HTMLCanvasElement) {
        this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
        this.renderer.outputColorSpace = SRGBColorSpace;
        this.renderer.setPixelRatio(Math.min(2, devicePixelRatio));
        this.renderer.localClippingEnabled = true;
        this.camera.up.set(0, 0, 1);
        const light = new DirectionalLight(0xffffff, 2.5);
        light.position.set(-0.5, 0.5, 0.9);
        this.camera.add(light);
        this.stage.fog = this.fog;
        const sky = new HemisphereLight(0xffffff, 0x8f8c88, 2.1);
        sky.position.set(0, 0, 1);
        this.stage.add(this.camera, sky, this.contents);
        this.controls = new OrbitControls(this.camera, canvas);
        this.controls.enableDamping = false;
        this.controls.addEventListener('change', () => this.draw());
        this.controls.addEventListener('start', () => (this.isTurned = true));
    }

    /** \param hasRoundings  whether it's shaded smoothly where it has one colour */
    show(content: Content, hasRoundings: boolean) {
        this.content = content;
        this.hasRoundings = hasRoundings;
        this.faces = null;
        this.whole = null;
        this.values = null;
        if (content.kind === 'tets') {
            this.values = { quality: tetQuality(content.mesh), edge: tetEdge(content.mesh) };
        } else if (content.kind === 'surface') {
            this.values = { quality: triangleQuality(content.mesh), edge: triangleEdge(content.mesh) };
        }
        this.middleEdge = this.values ? median(this.values.edge) : 1;
        if (!this.isFitted && content.mesh.positions.length > 0) {
            this.isFitted = true;
            this.fit();
        }
        this.rebuild();
    }

    colourBy(measure: Measure, reference: number | null) {
        this.measure = measure;
        this.reference = reference;
        this.rebuild();
    }

    cut(clip: Clip) {
        this.clip = clip;
        this.rebuild();
    }

    showEdges(hasEdges: boolean) {
        this.hasEdges = hasEdges;
        this.rebuild();
    }

    resize(width: number, height: number) {
        this.renderer.setSize(width, height, false);
        this.camera.aspect = width / Math.max(1, height);
        this.camera.updateProjectionMatrix();
        if (this.content && !this.isTurned) {
            this.fit();
        }
        this.draw();
    }

    /** Turns the body, for those without a mouse. */
    turn(right: number, up: number) {
        this.isTurned = true;
        const offset = this.camera.position.clone().sub(this.controls.target);
        offset.applyAxisAngle(new Vector3(0, 0, 1), -right * turnStep);
        const side = new Vector3().crossVectors(this.camera.up, offset).normalize();
        const tilted = offset.clone().applyAxisAngle(side, -up * turnStep);
        const slope = Math.abs(tilted.z) / tilted.length();
        this.camera.position.copy(this.controls.target).add(slope < 0.99 ? tilted : offset);
        this.controls.update();
        this.draw();
    }

    zoom(factor: number) {
        this.isTurned = true;
        this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
        this.controls.update();
        this.draw();
    }

    /** The whole body, from a little above its front, as large as it fits. */
    fit() {
        const { centre, radius } = this.bounds();
        this.radius = radius;
        const toEye = new Vector3(0.45, -1, 0.25).normalize();
        const right = new Vector3(0, 0, 1).cross(toEye).normalize();
        const up = toEye.clone().cross(right);
        const positions = this.content!.mesh.positions;
        const tanHalf = Math.tan((this.camera.fov * Math.PI) / 360);
        const margin = 1.08;
        const point = new Vector3();
        let away = 0;
        const stride = 3 * Math.max(1, Math.floor(positions.length / 3 / 20_000));
        for (let i = 0; i < positions.length; i += stride) {
            point.set(positions[i]!, positions[i + 1]!, positions[i + 2]!).sub(centre);
            const wanted = Math.max(Math.abs(point.dot(up)), Math.abs(point.dot(right)) / this.camera.aspect);
            if (Number.isFinite(wanted)) {
                away = Math.max(away, (margin * wanted) / tanHalf + point.dot(toEye));
            }
        }
        this.controls.target.copy(centre);
        this.camera.position.copy(centre).addScaledVector(toEye, Math.max(away, 1e-9));
        this.camera.near = radius / 100;
        this.camera.far = radius * 100;
        this.camera.updateProjectionMatrix();
        this.controls.update();
        this.draw();
    }

    dispose() {
        cancelAnimationFrame(this.frame);
        this.clear();
        this.controls.dispose();
        this.renderer.dispose();
        this.renderer.forceContextLoss();
    }

    /** Draws with the next frame. */
    draw() {
        this.frame ||= requestAnimationFrame(() => {
            this.frame = 0;
            // Particles in front and behind are told apart by how they fade.
            const away = this.camera.position.distanceTo(this.controls.target);
            this.fog.near = away - 0.5 * this.radius;
            this.fog.far = away + 0.9 * this.radius;
            if (this.lines) {
                this.lines.opacity = lineOpacity * Math.min(1, Math.max(0, (this.pixelsOfEdge(away) - 2) / 8));
            }
            this.renderer.render(this.stage, this.camera);
        });
    }

    /** Lines of a fine mesh seen from afar would hide its colours. */
    private pixelsOfEdge(away: number): number {
        const tanHalf = Math.tan((this.camera.fov * Math.PI) / 360);
        return (this.middleEdge / (2 * away * tanHalf)) * this.renderer.domElement.clientHeight;
    }

    private bounds() {
        const box = boxOf(this.content!.mesh.positions);
        const [low, high] = [new Vector3(...box.low), new Vector3(...box.high)];
        const centre = low.clone().add(high).multiplyScalar(0.5);
        return { centre, radius: Math.max(1e-9, high.distanceTo(low) / 2) };
    }

    private clear() {
        for (const child of this.contents.children as (Drawn | Points)[]) {
            child.geometry.dispose();
            for (const material of [child.material].flat()) {
                material.dispose();
            }
        }
        this.contents.clear();
        this.lines = null;
    }

    private rebuild() {
        if (!this.content) {
            return;
        }
        this.clear();
        const axis = (['x', 'y', 'z'] as const)[this.clip.axis];
        const side = cutFrom[this.clip.axis];
        const limit = side * cutOf(this.content.mesh.positions, this.clip);
        this.plane.normal.set(0, 0, 0);
        this.plane.normal[axis] = -side;
        this.plane.constant = limit;
        if (this.content.kind === 'tets') {
            this.addTets(this.content.mesh, limit);
            this.addGhost(this.content.mesh.positions, (this.whole ??= this.faces!.boundary(() => true).triangles));
        } else if (this.content.kind === 'surface') {
            this.addSurface(this.content.mesh.positions, this.content.mesh.triangles, (t) => t, this.clip.share > 0);
            this.addGhost(this.content.mesh.positions, this.content.mesh.triangles);
        } else {
            this.addParticles(this.content);
        }
        this.draw();
    }

    /** Whole tets are left out, so that their shape shows. */
    private addTets(mesh: TetMesh, limit: number) {
        this.faces ??= new TetFaces(mesh);
        const { positions, tets } = mesh;
        const axis = this.clip.axis;
        const side = cutFrom[axis];
        const isShown = (t: number) => {
            let sum = 0;
            for (let i = 0; i < 4; ++i) {
                sum += positions[3 * tets[4 * t + i]! + axis]!;
            }
            return (side * sum) / 4 <= limit || this.clip.share === 0;
        };
        const { triangles, owner } = this.faces.boundary(isShown);
        this.addSurface(positions, triangles, (i) => owner[i]!, false);
    }

    private addSurface(positions: Float32Array, triangles: Uint32Array, owner: (i: number) => number, isClipped: boolean) {
        const geometry = new BufferGeometry();
        const corners = new Float32Array(3 * triangles.length);
        const colours = new Float32Array(3 * triangles.length);
        const shade = new Color();
        const plain = new Color(colour('surface-3d'));
        const reference = this.reference ?? this.middleEdge;
        for (let i = 0; i < triangles.length; ++i) {
            for (let n = 0; n < 3; ++n) {
                corners[3 * i + n] = positions[3 * triangles[i]! + n]!;
            }
            if (i % 3 === 0) {
                const element = owner(i / 3);
                if (this.measure === 'plain' || !this.values) {
                    shade.copy(plain);
                } else if (this.measure === 'quality') {
                    shade.setRGB(...colourAt('quality', this.values.quality[element]!), SRGBColorSpace);
                } else {
                    shade.setRGB(...colourAt('edge', this.values.edge[element]! / reference - 0.5), SRGBColorSpace);
                }
            }
            colours.set([shade.r, shade.g, shade.b], 3 * i);
        }
        geometry.setAttribute('position', new BufferAttribute(corners, 3));
        geometry.setAttribute('color', new BufferAttribute(colours, 3));
        const isSmooth = this.hasRoundings && this.measure === 'plain' && this.content?.kind === 'surface';
        geometry.setAttribute('normal', new BufferAttribute(isSmooth ? cornerNormals(positions, triangles) : flat(corners), 3));
        const clippingPlanes = isClipped ? [this.plane] : [];
        const material = new MeshLambertMaterial({
            vertexColors: true,
            side: DoubleSide,
            fog: false,
            clippingPlanes,
            polygonOffset: true,
            polygonOffsetFactor: 1,
            polygonOffsetUnits: 1,
        });
        this.contents.add(new Drawn(geometry, material));
        if (this.hasEdges) {
            this.lines = new MeshBasicMaterial({
                color: 0x101418,
                wireframe: true,
                transparent: true,
                opacity: lineOpacity,
                fog: false,
                clippingPlanes,
            });
            this.contents.add(new Drawn(geometry, this.lines));
        }
    }

    /** What is cut away, as a shade of what it was: one sees which half is left. */
    private addGhost(positions: Float32Array, triangles: Uint32Array) {
        if (this.clip.share === 0) {
            return;
        }
        const geometry = new BufferGeometry();
        geometry.setAttribute('position', new BufferAttribute(positions, 3));
        geometry.setIndex(new BufferAttribute(triangles, 1));
        const material = new MeshBasicMaterial({
            color: colour('muted'),
            transparent: true,
            opacity: 0.1,
            depthWrite: false,
            fog: false,
            clippingPlanes: [this.plane.clone().negate()],
        });
        this.contents.add(new Drawn(geometry, material));
    }

    private addParticles(content: { mesh: Mesh; ghost: Mesh | null }) {
        const clippingPlanes = this.clip.share > 0 ? [this.plane] : [];
        if (content.ghost) {
            const geometry = new BufferGeometry();
            geometry.setAttribute('position', new BufferAttribute(content.ghost.positions, 3));
            geometry.setIndex(new BufferAttribute(content.ghost.triangles, 1));
            geometry.computeVertexNormals();
            const body = new MeshLambertMaterial({ color: colour('surface-3d'), fog: false, side: DoubleSide, clippingPlanes });
            this.contents.add(new Drawn(geometry, body));
        }
        this.fog.color.set(colour('stage-bottom'));
        const geometry = new BufferGeometry();
        geometry.setAttribute('position', new BufferAttribute(content.mesh.positions, 3));
        const size = (content.mesh.positions.length > 15_000 ? 3 : 4.5) * this.renderer.getPixelRatio();
        const dots = new PointsMaterial({ color: colour('ink-1'), size, sizeAttenuation: false, clippingPlanes });
        // Round, and drawn a little nearer than they are: the body they smooth hides only those behind it.
        const nearer = (0.02 * this.radius).toFixed(9);
        dots.onBeforeCompile = (shader) => {
            shader.vertexShader = shader.vertexShader.replace(
                '#include <project_vertex>',
                `#include <project_vertex>
                gl_Position = projectionMatrix * vec4(mvPosition.xyz * (1.0 - ${nearer} / length(mvPosition.xyz)), 1.0);`,
            );
            shader.fragmentShader = shader.fragmentShader.replace(
                '#include <clipping_planes_fragment>',
                `if (length(gl_PointCoord - 0.5) > 0.5) discard;
                #include <clipping_planes_fragment>`,
            );
        };
        this.contents.add(new Points(geometry, dots));
    }

    /** Colours of the style sheet changed. */
    restyle() {
        this.rebuild();
    }
}

/** The normal of its triangle at every corner. */
function flat(corners: Float32Array): Float32Array {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(corners, 3));
    geometry.computeVertexNormals();
    return geometry.getAttribute('normal').array as Float32Array;
}

/** The mean normal of the triangles around it at every corner, but for corners on sharp edges. */
function cornerNormals(positions: Float32Array, triangles: Uint32Array): Float32Array {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(positions, 3));
    geometry.setIndex(new BufferAttribute(triangles, 1));
    geometry.computeVertexNormals();
    const smooth = geometry.getAttribute('normal').array as Float32Array;
    const normals = new Float32Array(3 * triangles.length);
    const [a, b, c, own, mean] = Array.from({ length: 5 }, () => new Vector3());
    for (let i = 0; i < triangles.length; i += 3) {
        a!.fromArray(positions, 3 * triangles[i]!);
        b!.fromArray(positions, 3 * triangles[i + 1]!).sub(a!);
        c!.fromArray(positions, 3 * triangles[i + 2]!).sub(a!);
        own!.crossVectors(b!, c!).normalize();
        for (let n = 0; n < 3; ++n) {
            mean!.fromArray(smooth, 3 * triangles[i + n]!);
            (mean!.dot(own!) > cosOfSharp ? mean! : own!).toArray(normals, 3 * (i + n));
        }
    }
    return normals;
}
