import { useEffect, useMemo, useState } from 'preact/hooks';

import { signedOut, terminalStates, type Capabilities, type Job } from '../api';
import { follow, type Link } from '../follow';
import { ago, count, duration, fileName, moment, percent, ratio, roughly, sentence, word } from '../format';
import { stageName } from '../job_model';
import { Bar, LinkState, State } from '../parts/state';
import { jobPath, navigate } from '../router';

const filters = [
    ['All', () => true],
    ['Waiting', (job: Job) => job.state === 'STATE_QUEUED'],
    ['Running', (job: Job) => job.state === 'STATE_RUNNING' || job.state === 'STATE_CANCELLING'],
    ['Succeeded', (job: Job) => job.state === 'STATE_SUCCEEDED'],
    ['Stopped', (job: Job) => terminalStates.has(job.state) && job.state !== 'STATE_SUCCEEDED'],
] as const;

export function QueuePage(props: { capabilities: Capabilities | null }) {
    const { jobs, hasMore, link } = useQueue();
    const [filter, setFilter] = useState(0);
    const now = useNow();

    useEffect(() => {
        document.title = 'Queue · remesh';
    }, []);

    const figures = useMemo(() => figuresOf(jobs ?? [], props.capabilities?.workers ?? 1), [jobs, props.capabilities]);
    const shown = (jobs ?? []).filter(filters[filter]![1]);

    return (
        <>
            <div class="heading">
                <h1 tabIndex={-1}>Queue</h1>
                <LinkState link={link} />
                <a class="button primary" href="/new">
                    New job
                </a>
            </div>
            {jobs && jobs.length === 0 ? (
                <EmptyQueue />
            ) : (
                <>
                    <Tiles figures={figures} />
                    <div class="chips" role="group" aria-label="Show jobs">
                        {filters.map(([label, matches], index) => (
                            <button
                                key={label}
                                aria-pressed={index === filter}
                                onClick={() => setFilter(index)}
                            >
                                {label} <small>{(jobs ?? []).filter(matches).length}</small>
                            </button>
                        ))}
                    </div>
                    <div class="card table-card">
                        <table class="jobs">
                            <caption class="sr">Jobs, newest first</caption>
                            <thead>
                                <tr>
                                    <th scope="col">Surface</th>
                                    <th scope="col">State</th>
                                    <th scope="col">Progress</th>
                                    <th scope="col" class="right">
                                        Elements
                                    </th>
                                    <th scope="col" class="right">
                                        Quality
                                    </th>
                                    <th scope="col" class="right">
                                        Time
                                    </th>
                                    <th scope="col" class="right">
                                        Created
                                    </th>
                                </tr>
                            </thead>
                            <tbody>
                                {shown.map((job) => (
                                    <Row key={job.name} job={job} now={now} />
                                ))}
                            </tbody>
                        </table>
                        {shown.length === 0 && <p class="nothing">{jobs ? 'No such jobs.' : 'Loading…'}</p>}
                    </div>
                    {hasMore && <p class="hint">These are the newest 100. Older ones: remesh list.</p>}
                </>
            )}
        </>
    );
}

function Row(props: { job: Job; now: number }) {
    const { job, now } = props;
    const quality = job.result?.quality;
    const elements = quality?.tets?.tets ?? quality?.after?.triangles;
    const measure = quality?.tets?.radius_ratio ?? quality?.after?.radius_ratio;
    const path = jobPath(job.name);
    const isOver = terminalStates.has(job.state);
    return (
        <tr
            onClick={(event) => {
                if (!(event.target as Element).closest('a')) {
                    navigate(path);
                }
            }}
        >
            <th scope="row">
                <a href={path}>{fileName(job)}</a>
                <Labels labels={job.spec.labels} />
            </th>
            <td data-label="State">
                <State state={job.state} />
            </td>
            <td data-label="Progress" class={job.state === 'STATE_SUCCEEDED' || job.state === 'STATE_CANCELLED' ? 'progress none' : 'progress'}>
                <Standing job={job} now={now} />
            </td>
            <td data-label="Elements" class={elements ? 'right' : 'right none'}>
                {elements ? (
                    <>
                        {count(elements)} <small>{quality?.tets ? 'tets' : 'triangles'}</small>
                    </>
                ) : (
                    '–'
                )}
            </td>
            <td data-label="Quality" class={measure ? 'right' : 'right none'} title="Mean radius ratio: 1 is regular">
                {measure ? ratio(measure.mean) : '–'}
            </td>
            <td data-label="Time" class={job.start_time ? 'right' : 'right none'}>
                {job.start_time ? duration(((isOver ? Date.parse(job.end_time ?? '') : now) - Date.parse(job.start_time)) / 1000) : '–'}
            </td>
            <td data-label="Created" class="right">
                <time dateTime={job.create_time} title={moment(job.create_time)}>
                    {ago(job.create_time, now)}
                </time>
            </td>
        </tr>
    );
}

export function Labels(props: { labels?: Record<string, string> }) {
    const entries = Object.entries(props.labels ?? {});
    if (entries.length === 0) {
        return null;
    }
    return (
        <span class="labels">
            {entries.map(([key, value]) => (
                <span key={key}>
                    {key}: {value}
                </span>
            ))}
        </span>
    );
}

/** How far a job is, in a line. */
function Standing(props: { job: Job; now: number }) {
    const { job } = props;
    if (job.state === 'STATE_QUEUED') {
        const ahead = job.queue_position ?? 0;
        const wait = startsIn(job, props.now);
        return (
            <span class="muted">
                {ahead === 0 ? 'Next' : `${ahead} ahead`}
                {wait && `, starts in ${wait}`}
            </span>
        );
    }
    if (job.state === 'STATE_RUNNING' || job.state === 'STATE_CANCELLING') {
        const fraction = job.progress?.fraction ?? 0;
        return (
            <>
                <Bar fraction={fraction} label={`Progress of ${fileName(job)}`} />
                <small>
                    {percent(fraction, 0)} · {stageName(job.progress?.stage).toLowerCase()}
                </small>
            </>
        );
    }
    if (job.failure) {
        return <span class="muted clip">{sentence(job.failure.message || word(job.failure.reason))}</span>;
    }
    return <span class="muted">{job.state === 'STATE_SUCCEEDED' ? 'Done' : 'Stopped by request'}</span>;
}

/** How long until it starts, as the server guesses from the last jobs; empty while it doesn't know. */
export function startsIn(job: Job, now: number): string {
    return job.estimated_start_time ? roughly(Math.max(0, (Date.parse(job.estimated_start_time) - now) / 1000)) : '';
}

interface Figures {
    running: number;
    waiting: number;
    workers: number;
    done: number;
    lastHour: number;
    meanSeconds: number | null;
}

function figuresOf(jobs: Job[], workers: number): Figures {
    const ended = jobs.filter((job) => job.state === 'STATE_SUCCEEDED' && job.end_time && job.start_time);
    const recent = ended.slice(0, 20);
    const seconds = recent.map((job) => (Date.parse(job.end_time!) - Date.parse(job.start_time!)) / 1000);
    const hourAgo = Date.now() - 3_600_000;
    return {
        running: jobs.filter((job) => job.state === 'STATE_RUNNING' || job.state === 'STATE_CANCELLING').length,
        waiting: jobs.filter((job) => job.state === 'STATE_QUEUED').length,
        workers,
        done: ended.length,
        lastHour: ended.filter((job) => Date.parse(job.end_time!) > hourAgo).length,
        meanSeconds: seconds.length ? seconds.reduce((a, b) => a + b) / seconds.length : null,
    };
}

function Tiles(props: { figures: Figures }) {
    const { figures } = props;
    return (
        <dl class="tiles">
            <div>
                <dt>Running</dt>
                <dd>
                    {figures.running}
                    <small> of {figures.workers}</small>
                </dd>
            </div>
            <div>
                <dt>Waiting</dt>
                <dd>{figures.waiting}</dd>
            </div>
            <div>
                <dt>Done in the last hour</dt>
                <dd>{figures.lastHour}</dd>
            </div>
            <div>
                <dt>Mean time of a job</dt>
                <dd>{figures.meanSeconds === null ? '–' : duration(figures.meanSeconds)}</dd>
            </div>
        </dl>
    );
}

function EmptyQueue() {
    return (
        <section class="empty card">
            <svg viewBox="0 0 120 90" aria-hidden="true">
                <path d="M60 8 110 44 86 84 34 84 10 44Z" />
                <path d="M60 8 60 48 110 44M60 48 86 84M60 48 34 84M60 48 10 44" />
            </svg>
            <h2>Nothing to do</h2>
            <p>
                Drop a surface anywhere on this page, or choose one for a <a href="/new">new job</a>. STL, PLY, OBJ, OFF,
                VTK and GIfTI are read, damaged or not. Every job then shows up here, from its place in the queue to its
                result.
            </p>
            <p>
                From a shell: <code>remesh run surface.stl -o mesh.vtu</code>
            </p>
        </section>
    );
}

function useQueue() {
    const [jobs, setJobs] = useState<Job[] | null>(null);
    const [hasMore, setMore] = useState(false);
    const [link, setLink] = useState<Link>('connecting');
    useEffect(
        () =>
            follow({
                url: () => '/api/v1/events',
                events: {
                    jobs: (data) => {
                        const page = JSON.parse(data);
                        setJobs(page.jobs ?? []);
                        setMore(Boolean(page.next_page_token));
                    },
                },
                onLink: setLink,
                onRefused: (status) => status === 401 && signedOut(),
            }),
        [],
    );
    return { jobs, hasMore, link };
}

export function useNow(): number {
    const [now, setNow] = useState(Date.now());
    useEffect(() => {
        const timer = setInterval(() => setNow(Date.now()), 1000);
        return () => clearInterval(timer);
    }, []);
    return now;
}
