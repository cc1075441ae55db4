import { useEffect, useReducer, useRef, useState } from 'preact/hooks';

import { api, artifactUrl, pageUrl, signedOut, terminalStates, type Job, type Output } from '../api';
import { follow, type Link } from '../follow';
import { bytes, duration, fileName, percent, roughly, sentence, word } from '../format';
import { JobModel } from '../job_model';
import { MainCurves, MoreCurves } from '../parts/curves';
import { Defects, Warnings } from '../parts/defects';
import { Histograms } from '../parts/histograms';
import { Measures, Made } from '../parts/measures';
import { StageRail } from '../parts/stage_rail';
import { Bar, LinkState, State } from '../parts/state';
import { ViewPanel } from '../parts/view_panel';
import { jobPath, navigate } from '../router';
import { Labels, startsIn, useNow } from './queue';
import { randomId } from './submit';

export function JobPage(props: { name: string }) {
    const { model, link, refusal } = useJob(props.name);
    const job = model.job;

    useEffect(() => {
        document.title = job ? `${fileName(job)} · remesh` : 'remesh';
    }, [job && fileName(job)]);

    if (refusal) {
        return (
            <section class="empty card">
                <h1 tabIndex={-1}>No such job</h1>
                <p>
                    It was deleted, or never was yours. <a href="/">Back to the queue</a>
                </p>
            </section>
        );
    }
    if (!job) {
        return <p class="nothing">Loading…</p>;
    }
    return (
        <>
            <Heading job={job} link={link} />
            <Now model={model} job={job} />
            {job.failure && <Failure failure={job.failure} />}
            <Warnings warnings={model.warnings} told={job.result?.quality?.defects ?? []} />
            {terminalStates.has(job.state) && model.samples.length === 0 ? (
                <ViewPanel model={model} job={job} />
            ) : (
                <>
                    <div class="live">
                        <ViewPanel model={model} job={job} />
                        <MainCurves samples={model.samples} skipped={model.skipped} />
                    </div>
                    <MoreCurves samples={model.samples} />
                </>
            )}
            {job.result?.quality && (
                <>
                    <Histograms quality={job.result.quality} />
                    <Defects quality={job.result.quality} frame={job.spec.input.frame} />
                    <Measures quality={job.result.quality} frame={job.spec.input.frame} />
                </>
            )}
            <Made job={job} />
        </>
    );
}

function Heading(props: { job: Job; link: Link }) {
    const { job } = props;
    const [problem, setProblem] = useState('');
    const isOver = terminalStates.has(job.state);

    const act = async (action: () => Promise<unknown>) => {
        try {
            setProblem('');
            await action();
        } catch (error) {
            setProblem(error instanceof Error ? error.message : String(error));
        }
    };
    const isSuccess = job.state === 'STATE_SUCCEEDED';
    const runAgain = async () => {
        const { spec } = await api.job(job.name);
        const copy = isSuccess
            ? await api.create({ spec: { ...spec, skip_cache: true }, request_id: randomId() })
            : await api.retry(job.name, randomId());
        navigate(jobPath(copy.name));
    };
    const remove = async () => {
        if (confirm('Delete this job and its files? There is no way back.')) {
            await api.remove(job.name);
            navigate('/');
        }
    };

    return (
        <>
            <div class="heading job-heading">
                <div>
                    <p class="crumbs">
                        <a href="/">Queue</a>
                    </p>
                    <h1 tabIndex={-1}>{fileName(job)}</h1>
                    <p class="sub">
                        <State state={job.state} />
                        <LinkState link={isOver ? 'over' : props.link} />
                        <Labels labels={job.spec.labels} />
                    </p>
                </div>
                <div class="buttons">
                    {!isOver && (
                        <button
                            class="danger"
                            disabled={job.state === 'STATE_CANCELLING'}
                            onClick={() => act(() => api.cancel(job.name))}
                        >
                            Cancel
                        </button>
                    )}
                    {isOver && <button onClick={() => act(runAgain)}>{isSuccess ? 'Run again' : 'Retry'}</button>}
                    {isOver && (
                        <button class="danger" onClick={() => act(remove)}>
                            Delete
                        </button>
                    )}
                </div>
            </div>
            {problem && (
                <p class="notice problem" role="alert">
                    {problem}
                </p>
            )}
            <Downloads outputs={(job.result ?? job.failure)?.outputs ?? []} areDrafts={Boolean(job.failure)} />
        </>
    );
}

/** What helps, by reason; docs/troubleshooting.md says more. */
const advice: Record<string, string> = {
    INVALID_INPUT: 'The file is damaged or an option doesn’t suit it. Export the surface again and compare the sizes.',
    UNSUPPORTED: 'Save the surface as STL, PLY, OBJ, OFF, VTP, legacy VTK or GIfTI.',
    UNMESHABLE: 'Is it one closed body, whatever its holes? If so, try a smaller edge length.',
    TOO_LARGE: 'Ask for a larger edge length, or whoever runs the server for more memory.',
    BOUND_NOT_MET: 'The files are drafts: look where it falls short, then loosen the bound, try another edge length or repair the input.',
    TIMEOUT: 'Ask for a larger edge length or a longer time.',
    STORAGE: 'The server’s disk is full or failing: whoever runs it can tell. Retry then.',
    WORKER_LOST: 'It crashed or ran out of memory more than once. Keep the input and report it.',
    INTERNAL: 'This is a defect of remesh. Keep the input and report it.',
};

function Failure(props: { failure: NonNullable<Job['failure']> }) {
    const { failure } = props;
    const help = advice[failure.reason ?? ''];
    return (
        <div class="notice problem" role="alert">
            <strong>{sentence(failure.message || word(failure.reason))}</strong>
            <p>
                {help && `${help} `}
                <small class="muted">
                    {failure.reason}
                    {failure.stage && failure.stage !== 'STAGE_UNSPECIFIED' && ` in stage ${word(failure.stage)}`}
                </small>
            </p>
        </div>
    );
}

const kindWords: Record<string, string> = {
    KIND_SURFACE: 'surface',
    KIND_TETRAHEDRA: 'tetrahedra',
    KIND_REPORT: 'report, JSON',
};

const isMesh = (output: Output) => output.kind === 'KIND_SURFACE' || output.kind === 'KIND_TETRAHEDRA';

function Downloads(props: { outputs: Output[]; areDrafts: boolean }) {
    const page = props.outputs.find((output) => output.kind === 'KIND_REPORT_PAGE');
    const files = props.outputs.filter((output) => output.kind in kindWords);
    if (files.length === 0) {
        return null;
    }
    return (
        <ul class="downloads" aria-label="Downloads">
            {page && (
                <li>
                    <a class="button primary" href={pageUrl(page.digest)} target="_blank" rel="noreferrer">
                        Open report
                    </a>
                </li>
            )}
            {[...files, ...(page ? [page] : [])].map((output) => (
                <li key={output.digest.sha256 + output.file_name}>
                    <a class="button" href={artifactUrl(output.digest, output.file_name ?? 'result')} download>
                        <span>{output.file_name}</span>
                        <small>
                            {props.areDrafts && isMesh(output) && 'draft, '}
                            {kindWords[output.kind] ?? 'report, page'} · {bytes(output.digest.size_bytes)}
                        </small>
                    </a>
                </li>
            ))}
        </ul>
    );
}

/** Where the job stands: its stages, its progress, its time. */
function Now(props: { model: JobModel; job: Job }) {
    const { job } = props;
    const now = useNow();
    const isOver = terminalStates.has(job.state);
    const end = isOver ? Date.parse(job.end_time ?? '') : now;
    const seconds = job.start_time ? (end - Date.parse(job.start_time)) / 1000 : NaN;
    const fraction = job.progress?.fraction ?? 0;
    const left = fraction > 0.05 ? (seconds * (1 - fraction)) / fraction : NaN;
    return (
        <section class="card now" aria-label="Progress">
            {job.state === 'STATE_QUEUED' ? (
                <p>
                    Waits for a worker. {job.queue_position ? `${job.queue_position} ahead of it` : 'It is next'}
                    {startsIn(job, now) && `, starts in ${startsIn(job, now)}`}.
                </p>
            ) : (
                <>
                    <div class="now-line">
                        <strong>{isOver ? sentence(word(job.state)) : percent(fraction, 0)}</strong>
                        <span class="muted">
                            {isOver ? `${job.state === 'STATE_SUCCEEDED' ? 'in' : 'after'} ${duration(seconds)}` : duration(seconds)}
                            {!isOver && Number.isFinite(left) && `, ${roughly(left)} left`}
                            {(job.attempt ?? 0) > 1 && ` · attempt ${job.attempt} of ${job.max_attempts}`}
                        </span>
                    </div>
                    <Bar fraction={job.state === 'STATE_SUCCEEDED' ? 1 : fraction} label="Progress of the job" />
                    <StageRail model={props.model} job={job} now={now} />
                </>
            )}
        </section>
    );
}

/** Follows a job; draws at most once a frame, however fast events come. */
function useJob(name: string) {
    const model = useRef(new JobModel()).current;
    const [link, setLink] = useState<Link>('connecting');
    const [refusal, setRefusal] = useState(0);
    const [, redraw] = useReducer((turn: number) => turn + 1, 0);
    useEffect(() => {
        let frame = 0;
        const handle = (data: string) => {
            model.apply(JSON.parse(data));
            frame ||= requestAnimationFrame(() => {
                frame = 0;
                redraw(0);
            });
        };
        const stop = follow({
            url: (after) => `/api/v1/${name}/events${after ? `?after=${after}` : ''}`,
            events: {
                snapshot: handle,
                progress: handle,
                sample: handle,
                warning: handle,
                preview: handle,
                completed: handle,
            },
            onLink: setLink,
            onRefused: (status) => (status === 401 ? signedOut() : setRefusal(status)),
            isOver: () => model.isComplete,
        });
        return () => {
            stop();
            cancelAnimationFrame(frame);
        };
    }, [name]);
    return { model, link, refusal };
}
