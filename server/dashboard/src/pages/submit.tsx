import { useEffect, useRef, useState } from 'preact/hooks';

import { api, ApiError, upload, type Capabilities } from '../api';
import { receive } from '../dropped';
import { bytes, word } from '../format';
import { Bar } from '../parts/state';
import { jobPath, navigate } from '../router';

interface Item {
    file: File;
    state: 'waiting' | 'reading' | 'sending' | 'sent' | 'failed';
    fraction: number;
    problem?: string;
    name?: string;
}

interface Form {
    edgeLength: string;
    tetrahedra: boolean;
    unit: string;
    space: string;
    formats: string[];
    smoothing: string;
    closeHoles: boolean;
    mode: string;
    label: string;
}

const defaults: Form = {
    edgeLength: '',
    tetrahedra: true,
    unit: '',
    space: '',
    formats: ['FORMAT_VTU', 'FORMAT_PLY'],
    smoothing: '',
    closeHoles: true,
    mode: '',
    label: '',
};

export function SubmitPage(props: { capabilities: Capabilities | null }) {
    const [items, setItems] = useState<Item[]>([]);
    const [form, setForm] = useState(defaults);
    const [problem, setProblem] = useState<ApiError | Error | null>(null);
    const [isBusy, setBusy] = useState(false);

    useEffect(() => {
        document.title = 'New job · remesh';
        return receive((files) => addFiles(files));
    }, []);

    const addFiles = (files: File[]) => {
        setItems((old) => [...old, ...files.map((file): Item => ({ file, state: 'waiting', fraction: 0 }))]);
    };
    const change = (part: Partial<Form>) => setForm((old) => ({ ...old, ...part }));
    const update = (file: File, part: Partial<Item>) =>
        setItems((old) => old.map((item) => (item.file === file ? { ...item, ...part } : item)));

    const submit = async (event: Event) => {
        event.preventDefault();
        setProblem(null);
        setBusy(true);
        const made: string[] = [];
        for (const { file, state } of items) {
            if (state === 'sent') {
                continue;
            }
            try {
                update(file, { state: 'reading', fraction: 0, problem: undefined });
                const digest = await upload(file, (fraction) => update(file, { state: 'sending', fraction }));
                const job = await api.create(requestFor(file, digest, form));
                update(file, { state: 'sent', name: job.name });
                made.push(job.name);
            } catch (error) {
                const failure = error instanceof Error ? error : new Error(String(error));
                update(file, { state: 'failed', problem: failure.message });
                setProblem(failure);
            }
        }
        setBusy(false);
        if (made.length === items.length) {
            navigate(made.length === 1 ? jobPath(made[0]!) : '/');
        }
    };

    const isReady = items.some((item) => item.state !== 'sent') && form.formats.length > 0;
    return (
        <>
            <div class="heading">
                <h1 tabIndex={-1}>New job</h1>
            </div>
            <div class="submit-page">
                <form class="submit" onSubmit={submit}>
                    <div class="card">
                        <FilePicker capabilities={props.capabilities} onFiles={addFiles} />
                        {items.length > 0 && (
                            <ul class="files">
                                {items.map((item) => (
                                    <FileRow
                                        key={item.file.name + item.file.lastModified}
                                        item={item}
                                        onRemove={() => setItems((old) => old.filter((other) => other !== item))}
                                    />
                                ))}
                            </ul>
                        )}
                    </div>
                    <Options form={form} change={change} capabilities={props.capabilities} />
                    {problem && <Problem error={problem} />}
                    <div class="actions">
                        <button class="primary" disabled={!isReady || isBusy}>
                            {isBusy ? 'Sending…' : items.length > 1 ? `Remesh ${items.length} surfaces` : 'Remesh'}
                        </button>
                        <p class="hint">
                            Never put patient data into labels: file names and labels are shown to everyone of your tenant.
                        </p>
                    </div>
                </form>
                <Journey />
            </div>
        </>
    );
}

const steps = [
    ['Repaired', 'Duplicates, flipped and crossing triangles, loose specks and holes are dealt with, and every repair is reported.'],
    ['Smoothed', 'Stairs of voxels and noise are evened out, by no more than about half an edge length.'],
    ['Relaxed', 'Particles spread evenly over the surface and inside it, pushed apart by springs, until nothing moves.'],
    ['Meshed', 'A Delaunay tetrahedralization connects them; flips and small moves improve its worst elements.'],
    ['Checked', 'Closed, manifold, free of self-intersections, no inverted tetrahedron: exactly, or the job fails and says why.'],
] as const;

/** For who is here for the first time. */
function Journey() {
    return (
        <aside class="journey" aria-labelledby="journey-title">
            <h2 id="journey-title">What becomes of a surface</h2>
            <ol>
                {steps.map(([name, text]) => (
                    <li key={name}>
                        <strong>{name}</strong>
                        <p>{text}</p>
                    </li>
                ))}
            </ol>
            <p class="hint">The defaults suit most anatomy. An empty edge length is chosen from the surface, and said.</p>
        </aside>
    );
}

function FilePicker(props: { capabilities: Capabilities | null; onFiles: (files: File[]) => void }) {
    const input = useRef<HTMLInputElement>(null);
    const readable = props.capabilities?.formats.filter((format) => format.can_read) ?? [];
    return (
        <label class="picker">
            <input
                ref={input}
                class="sr"
                type="file"
                multiple
                onChange={(event) => {
                    props.onFiles([...(event.currentTarget.files ?? [])]);
                    event.currentTarget.value = '';
                }}
            />
            <svg viewBox="0 0 32 32" aria-hidden="true">
                <path d="M16 22V6m0 0-6 6m6-6 6 6M5 22v4h22v-4" />
            </svg>
            <strong>Drop surfaces here, or choose files</strong>
            <span>
                {readable.length > 0
                    ? readable.map((format) => word(format.format).toUpperCase().replace('GIFTI', 'GIfTI')).join(', ')
                    : 'STL, PLY, OBJ, OFF, VTP, VTK'}
                {', gzipped or not'}
                {props.capabilities?.max_artifact_bytes && ` · at most ${bytes(props.capabilities.max_artifact_bytes)}`}
            </span>
        </label>
    );
}

function FileRow(props: { item: Item; onRemove: () => void }) {
    const { item } = props;
    return (
        <li>
            <span class="name">{item.file.name}</span>
            <span class="muted">{bytes(item.file.size)}</span>
            {item.state === 'reading' && <span class="muted">Checksum…</span>}
            {item.state === 'sending' && <Bar fraction={item.fraction} label={`Upload of ${item.file.name}`} />}
            {item.state === 'sent' && item.name && <a href={jobPath(item.name)}>Queued</a>}
            {item.problem && <span class="problem">{item.problem}</span>}
            {(item.state === 'waiting' || item.state === 'failed') && (
                <button type="button" class="quiet" aria-label={`Remove ${item.file.name}`} onClick={props.onRemove}>
                    Remove
                </button>
            )}
        </li>
    );
}

function Options(props: { form: Form; change: (part: Partial<Form>) => void; capabilities: Capabilities | null }) {
    const { form, change } = props;
    const formats = (props.capabilities?.formats ?? []).filter((format) =>
        form.tetrahedra ? format.can_write_surface || format.can_write_tetrahedra : format.can_write_surface,
    );
    return (
        <div class="card options">
            <fieldset>
                <legend>Mesh</legend>
                <div class="segments">
                    {[true, false].map((tetrahedra) => (
                        <label key={String(tetrahedra)}>
                            <input
                                type="radio"
                                name="content"
                                checked={form.tetrahedra === tetrahedra}
                                onChange={() =>
                                    change({
                                        tetrahedra,
                                        formats: tetrahedra ? defaults.formats : ['FORMAT_PLY', 'FORMAT_STL'],
                                    })
                                }
                            />
                            <span>{tetrahedra ? 'Tetrahedra' : 'Surface only'}</span>
                        </label>
                    ))}
                </div>
            </fieldset>
            <label>
                Edge length, in the unit of the file
                <input
                    type="number"
                    min="0"
                    step="any"
                    inputMode="decimal"
                    placeholder="chosen from the surface"
                    value={form.edgeLength}
                    onInput={(event) => change({ edgeLength: event.currentTarget.value })}
                />
            </label>
            <label>
                Unit of the file
                <select value={form.unit} onChange={(event) => change({ unit: event.currentTarget.value })}>
                    <option value="">not said</option>
                    <option value="UNIT_MILLIMETER">millimetres</option>
                    <option value="UNIT_CENTIMETER">centimetres</option>
                    <option value="UNIT_METER">metres</option>
                </select>
            </label>
            <fieldset class="wide">
                <legend>Files wanted back</legend>
                <div class="checks">
                    {formats.map((format) => (
                        <label key={format.format}>
                            <input
                                type="checkbox"
                                checked={form.formats.includes(format.format)}
                                onChange={(event) =>
                                    change({
                                        formats: event.currentTarget.checked
                                            ? [...form.formats, format.format]
                                            : form.formats.filter((name) => name !== format.format),
                                    })
                                }
                            />
                            <span>
                                {formatName(format.format)}{' '}
                                <small>
                                    {form.tetrahedra && format.can_write_tetrahedra ? 'tetrahedra' : 'surface'}
                                </small>
                            </span>
                        </label>
                    ))}
                </div>
                <p class="hint">The quality report, as a page and as JSON, always comes too.</p>
            </fieldset>
            <details class="wide">
                <summary>More options</summary>
                <div class="more">
                    <label>
                        Smoothing of stairs and noise
                        <select
                            value={form.smoothing}
                            onChange={(event) => change({ smoothing: event.currentTarget.value })}
                        >
                            <option value="">where the surface shows them</option>
                            <option value="SMOOTHING_OFF">never</option>
                            <option value="SMOOTHING_ON">always</option>
                        </select>
                    </label>
                    <label>
                        Aim of the improvement
                        <select value={form.mode} onChange={(event) => change({ mode: event.currentTarget.value })}>
                            <option value="">balanced</option>
                            <option value="MODE_MAX_MIN_ANGLE">worst angle first</option>
                            <option value="MODE_STRICT_DELAUNAY">none, strictly Delaunay</option>
                        </select>
                    </label>
                    <label>
                        Space of the coordinates
                        <select value={form.space} onChange={(event) => change({ space: event.currentTarget.value })}>
                            <option value="">not said</option>
                            <option value="SPACE_LPS">LPS, as in DICOM and ITK</option>
                            <option value="SPACE_RAS">RAS, as in NIfTI and FreeSurfer</option>
                        </select>
                    </label>
                    <label>
                        Note, shown with the job
                        <input
                            maxLength={256}
                            value={form.label}
                            onInput={(event) => change({ label: event.currentTarget.value })}
                        />
                    </label>
                    <label class="check">
                        <input
                            type="checkbox"
                            checked={form.closeHoles}
                            onChange={(event) => change({ closeHoles: event.currentTarget.checked })}
                        />
                        <span>Close holes</span>
                    </label>
                </div>
            </details>
        </div>
    );
}

/** "FORMAT_MSH41" as people write it. */
function formatName(format: string): string {
    return word(format).toUpperCase().replace(/(\d)(\d)$/, ' $1.$2').replace('MEDIT', 'Medit');
}

function Problem(props: { error: Error }) {
    const fields = props.error instanceof ApiError ? props.error.fields : [];
    return (
        <div class="notice problem" role="alert">
            {fields.length === 0 ? props.error.message : null}
            {fields.map((field) => (
                <p key={field.field}>{field.description}</p>
            ))}
        </div>
    );
}

function requestFor(file: File, digest: object, form: Form): object {
    const edgeLength = Number(form.edgeLength);
    // What isn't said isn't sent: equal jobs shall be equal, whoever sent them.
    const frame = Object.entries({ unit: form.unit, space: form.space }).filter(([, value]) => value);
    return {
        request_id: randomId(),
        spec: {
            input: {
                digest,
                file_name: file.name,
                ...(frame.length > 0 ? { frame: Object.fromEntries(frame) } : {}),
            },
            options: {
                ...(form.edgeLength ? { edge_length: edgeLength } : {}),
                ...(form.tetrahedra ? {} : { tetrahedra: false }),
                prepare: {
                    ...(form.smoothing ? { smoothing: form.smoothing } : {}),
                    ...(form.closeHoles ? {} : { close_holes: false }),
                },
                ...(form.mode ? { improvement: { mode: form.mode } } : {}),
            },
            outputs: form.formats.map((format) => ({ format })),
            ...(form.label ? { labels: { note: form.label } } : {}),
        },
    };
}

/** Makes a repeated request the same one. */
export function randomId(): string {
    const words = crypto.getRandomValues(new Uint32Array(4));
    return Array.from(words, (value) => value.toString(36)).join('');
}
