import type { ComponentChildren } from 'preact';
import { useEffect, useMemo, useReducer, useRef, useState } from 'preact/hooks';

import { fetchArtifact, type Digest, type Job } from '../api';
import { axisNames, count, number, unitSign } from '../format';
import type { JobModel } from '../job_model';
import { onThemeChange } from '../theme';
import { gradientOf, type Measure } from '../view/colours';
import { cutOf, type Clip, type Mesh } from '../view/mesh';
import { readPly, readStl, readVtu, unzipped, Unreadable } from '../view/read';
import type { Content, Scene } from '../view/scene';

type InputKind = 'stl' | 'ply' | null;
type Source = 'input' | 'live' | 'result' | 'tets';

const sourceLabels: Record<Source, string> = {
    input: 'Input',
    live: 'Live',
    result: 'Surface',
    tets: 'Tetrahedra',
};
const measureLabels: Record<Measure, string> = {
    quality: 'Element quality',
    edge: 'Edge length',
    plain: 'One colour',
};

// A view of more would keep the browser busy for longer than anyone waits.
const largestInput = 60e6;

/** The body in 3-D: as it came, while it relaxes, and as it left. */
export function ViewPanel(props: { model: JobModel; job: Job }) {
    const { model, job } = props;
    const outputs = (job.result ?? job.failure)?.outputs ?? [];
    const surface = outputs.find((output) => output.kind === 'KIND_PREVIEW');
    const tets = outputs.find((output) => output.kind === 'KIND_PREVIEW_TETRAHEDRA');
    const inputKind = kindOfInput(job);
    const available: Source[] = [
        ...(inputKind ? (['input'] as const) : []),
        ...(!surface && model.preview ? (['live'] as const) : []),
        ...(surface ? (['result'] as const) : []),
        ...(tets ? (['tets'] as const) : []),
    ];
    const [chosen, setChosen] = useState<Source | null>(null);
    const newest: Source | undefined = surface ? 'result' : model.preview ? 'live' : available[0];
    const source = chosen && available.includes(chosen) ? chosen : newest;

    const [measure, setMeasure] = useState<Measure>('quality');
    const [clip, setClip] = useState<Clip>({ axis: 1, share: 0 });
    const [hasEdges, setEdges] = useState(true);
    const frame = job.spec.input.frame;
    const sign = unitSign(frame);
    const h = job.result?.quality?.edge_length ?? null;

    const digest =
        source === 'input'
            ? job.spec.input.digest
            : source === 'live'
              ? model.preview?.digest
              : source === 'result'
                ? surface?.digest
                : tets?.digest;
    const { content, problem } = useContent(source, digest, inputKind, job.spec.input.digest);
    // The triangles of a thinned-out view aren't those of the mesh.
    const isThinned = content?.kind === 'surface' && isThinner(source, content.mesh, model, job);
    const shownMeasure = isThinned ? 'plain' : measure;
    const cutAt = useMemo(() => (content && clip.share > 0 ? cutOf(content.mesh.positions, clip) : null), [content, clip]);

    return (
        <section class="card view" aria-labelledby="view-title">
            <div class="view-head">
                <h2 id="view-title" class="sr">
                    3-D view
                </h2>
                <div class="segments" role="radiogroup" aria-label="What is shown">
                    {available.map((name) => (
                        <label key={name}>
                            <input type="radio" name="source" checked={source === name} onChange={() => setChosen(name)} />
                            <span>{sourceLabels[name]}</span>
                        </label>
                    ))}
                </div>
                <span class="muted view-count">
                    {describe(content)}
                    {isThinned && (source === 'live' ? ', thinned out while it runs' : ', thinned out to be shown')}
                </span>
            </div>
            <Stage
                content={content}
                measure={shownMeasure}
                hasRoundings={source !== 'input'}
                clip={clip} 
                hasEdges={hasEdges && !isThinned}
                reference={source === 'input' ? null : h}
            >
                {problem ? <p class="nothing">{problem}</p> : !content && <p class="nothing">{waiting(job, source)}</p>}
            </Stage>
            <div class="view-controls">
                <label>
                    Colour by
                    <select
                        value={shownMeasure}
                        disabled={isThinned || content?.kind === 'particles'}
                        onChange={(event) => setMeasure(event.currentTarget.value as Measure)}
                    >
                        {(Object.keys(measureLabels) as Measure[]).map((name) => (
                            <option key={name} value={name}>
                                {measureLabels[name]}
                            </option>
                        ))}
                    </select>
                </label>
                <Scale
                    measure={content?.kind === 'particles' ? 'plain' : shownMeasure}
                    h={source === 'input' ? null : h}
                    sign={sign}
                />
                <span class="cut">
                    <label>
                        Cut along
                        <select
                            value={clip.axis}
                            onChange={(event) => setClip({ ...clip, axis: Number(event.currentTarget.value) as 0 | 1 | 2 })}
                        >
                            {axisNames(frame).map((name, axis) => (
                                <option key={name} value={axis}>
                                    {name}
                                </option>
                            ))}
                        </select>
                    </label>
                    <label class="slider">
                        <span class="sr">Share that is cut away</span>
                        <input
                            type="range"
                            min="0"
                            max="1"
                            step="0.01"
                            value={clip.share}
                            onInput={(event) => setClip({ ...clip, share: Number(event.currentTarget.value) })}
                        />
                    </label>
                    <output>{cutAt === null ? 'whole' : `${'xyz'[clip.axis]} = ${number(cutAt)}${sign && ` ${sign}`}`}</output>
                </span>
                <label class="check">
                    <input type="checkbox" checked={hasEdges} onChange={(event) => setEdges(event.currentTarget.checked)} />
                    <span>Edges</span>
                </label>
            </div>
        </section>
    );
}

function isThinner(source: Source | undefined, mesh: Mesh, model: JobModel, job: Job): boolean {
    if (source === 'result' && job.result?.quality?.after?.triangles) {
        return mesh.triangles.length / 3 < Number(job.result.quality.after.triangles);
    }
    // While it runs, and of drafts, which have no report here, the particles tell.
    const known = model.samples.findLast((sample) => sample.surface_particles)?.surface_particles;
    return (source === 'live' || source === 'result') && mesh.positions.length / 3 < 0.9 * Number(known ?? 0);
}

function describe(content: Content | null): string {
    if (!content) {
        return '';
    }
    if (content.kind === 'particles') {
        return `${count(content.mesh.positions.length / 3)} particles`;
    }
    return content.kind === 'tets'
        ? `${count(content.mesh.tets.length / 4)} tetrahedra`
        : `${count(content.mesh.triangles.length / 3)} triangles`;
}

function waiting(job: Job, source: Source | undefined): string {
    if (source) {
        return 'Loading…';
    }
    return job.state === 'STATE_QUEUED' || job.state === 'STATE_RUNNING' ? 'The first view comes while it runs.' : 'There is no view of this job.';
}

function Scale(props: { measure: Measure; h: number | null; sign: string }) {
    if (props.measure === 'plain') {
        return null;
    }
    // Where h isn't known, edges are compared with the middle one.
    const edge = (name: string, factor: number) =>
        props.h ? `${name} h, ${number(factor * props.h)}${props.sign && ` ${props.sign}`}` : `${name} × median`;
    const [low, high] = props.measure === 'quality' ? ['0 degenerate', '1 regular'] : [edge('½', 0.5), edge('1½', 1.5)];
    return (
        <span class="scale">
            <small>{low}</small>
            <i style={{ background: gradientOf(props.measure) }} aria-hidden="true" />
            <small>{high}</small>
        </span>
    );
}

function kindOfInput(job: Job): InputKind {
    const name = (job.spec.input.file_name ?? '').toLowerCase().replace(/\.gz$/, '');
    const isSmall = Number(job.spec.input.digest?.size_bytes ?? 0) <= largestInput;
    if (!isSmall) {
        return null;
    }
    return job.spec.input.format === 'FORMAT_STL' || name.endsWith('.stl')
        ? 'stl'
        : job.spec.input.format === 'FORMAT_PLY' || name.endsWith('.ply')
          ? 'ply'
          : null;
}

/** What a source holds, loaded. While the next one loads, the last one stays. */
function useContent(source: Source | undefined, digest: Digest | undefined, inputKind: InputKind, input: Digest) {
    const [content, setContent] = useState<Content | null>(null);
    const [problem, setProblem] = useState('');
    const ghost = useRef<Mesh | null>(null);
    const isBusy = useRef(false);
    const [loads, countLoad] = useReducer((n: number) => n + 1, 0);
    const loaded = useRef('');

    useEffect(() => {
        // One at a time: on a slow line previews are skipped, not queued.
        const wanted = source && digest ? `${source} ${digest.sha256}` : '';
        if (!source || !digest || isBusy.current || wanted === loaded.current) {
            return;
        }
        isBusy.current = true;
        loaded.current = wanted;
        load(source, digest, { kind: inputKind, digest: input }, ghost)
            .then(
                (next) => {
                    setContent(next);
                    setProblem('');
                },
                (error) => {
                    // An old preview may be gone by now: the next one comes.
                    if (source !== 'live') {
                        setProblem(error instanceof Unreadable ? error.message : 'This could not be loaded.');
                    }
                },
            )
            .finally(() => {
                isBusy.current = false;
                countLoad(0);
            });
    }, [source, digest?.sha256, loads]);
    return { content: problem ? null : content, problem };
}

async function readInput(bytes: ArrayBuffer, kind: InputKind): Promise<Mesh> {
    const plain = await unzipped(bytes);
    return kind === 'stl' ? readStl(plain) : readPly(plain);
}

async function load(
    source: Source,
    digest: Digest,
    input: { kind: InputKind; digest: Digest },
    ghost: { current: Mesh | null },
): Promise<Content> {
    const bytes = await fetchArtifact(digest);
    if (source === 'tets') {
        return { kind: 'tets', mesh: await readVtu(bytes) };
    }
    const mesh = source === 'input' ? await readInput(bytes, input.kind) : readPly(bytes);
    if (mesh.triangles.length === 0 && source === 'live') {
        if (!ghost.current && input.kind) {
            ghost.current = await fetchArtifact(input.digest).then(
                (original) => readInput(original, input.kind),
                () => null,
            );
        }
        return { kind: 'particles', mesh, ghost: ghost.current };
    }
    ghost.current = mesh;
    return { kind: 'surface', mesh };
}

const keys: Record<string, (scene: Scene) => void> = {
    ArrowLeft: (scene) => scene.turn(-1, 0),
    ArrowRight: (scene) => scene.turn(1, 0),
    ArrowUp: (scene) => scene.turn(0, 1),
    ArrowDown: (scene) => scene.turn(0, -1),
    '+': (scene) => scene.zoom(0.9),
    '-': (scene) => scene.zoom(1.1),
    '0': (scene) => scene.fit(),
};

function Stage(props: {
    content: Content | null;
    measure: Measure;
    /** Whether it may be shaded smoothly: stairs of an input shall show. */
    hasRoundings: boolean;
    clip: Clip;
    hasEdges: boolean;
    reference: number | null;
    children: ComponentChildren;
}) {
    const canvas = useRef<HTMLCanvasElement>(null);
    const [scene, setScene] = useState<Scene | null>(null);
    const [problem, setProblem] = useState('');

    useEffect(() => {
        let made: Scene | null = null;
        let isGone = false;
        const element = canvas.current!;
        const observer = new ResizeObserver(() => made?.resize(element.clientWidth, element.clientHeight));
        // The library is a third of the page: it comes when there is something to draw with it.
        import('../view/scene').then(
            (module) => {
                if (!isGone) {
                    try {
                        made = new module.Scene(element);
                        observer.observe(element);
                        setScene(made);
                    } catch {
                        setProblem('This browser has no WebGL: the numbers below say the same.');
                    }
                }
            },
            () => setProblem('The 3-D view could not be loaded.'),
        );
        const forget = onThemeChange(() => made?.restyle());
        return () => {
            isGone = true;
            forget();
            observer.disconnect();
            made?.dispose();
        };
    }, []);
    useEffect(() => scene?.colourBy(props.measure, props.reference), [scene, props.measure, props.reference]);
    useEffect(() => scene?.cut(props.clip), [scene, props.clip]);
    useEffect(() => scene?.showEdges(props.hasEdges), [scene, props.hasEdges]);
    useEffect(() => {
        if (scene && props.content) {
            scene.show(props.content, props.hasRoundings);
        }
    }, [scene, props.content, props.hasRoundings]);

    return (
        <div class="stage">
            <canvas
                ref={canvas}
                tabIndex={0}
                role="img"
                data-ready={scene && props.content ? 'yes' : 'no'}
                aria-label={`3-D view: ${describe(props.content) || 'nothing yet'}. Arrow keys turn it, plus and minus zoom, 0 shows all.`}
                onKeyDown={(event) => {
                    const act = keys[event.key];
                    if (scene && act) {
                        event.preventDefault();
                        act(scene);
                    }
                }}
            />
            {problem ? <p class="nothing">{problem}</p> : props.children}
            <p class="stage-hint" aria-hidden="true">
                drag to turn · scroll to zoom · right-drag to move
            </p>
        </div>
    );
}
