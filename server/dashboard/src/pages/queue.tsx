import { useEffect, useMemo, useRef, useState } from 'preact/hooks';

import { api, signedOut, terminalStates, type Capabilities, type Job, type JobList, type QueueSummary } from '../api';
import { follow, type Link } from '../follow';
import { ago, brief, count, duration, fileName, moment, percent, ratio, roughly, sentence, word } from '../format';
import { stageName } from '../job_model';
import { Bar, LinkState, State } from '../parts/state';
import { TenantChips, TenantTable } from '../parts/tenants';
import { Throughput } from '../parts/throughput';
import { inOrder, total, totalsOf, type Totals } from '../queue_model';
import { jobPath, navigate } from '../router';

const filters = [
    ['All', () => true],
    ['Waiting', (job: Job) => job.state === 'STATE_QUEUED'],
    ['Running', (job: Job) => job.state === 'STATE_RUNNING' || job.state === 'STATE_CANCELLING'],
    ['Succeeded', (job: Job) => job.state === 'STATE_SUCCEEDED'],
    ['Stopped', (job: Job) => terminalStates.has(job.state) && job.state !== 'STATE_SUCCEEDED'],
] as const;

export function QueuePage(props: { capabilities: Capabilities | null }) {
    const { jobs, summary, hasMore, showOlder, link } = useQueue();
    const [filter, setFilter] = useState(0);
    const [tenant, setTenant] = useState<string | null>(null);
    const now = useNow();

    useEffect(() => {
        document.title = 'Queue · remesh';
    }, []);

    const seesOthers = (summary?.tenants.length ?? 0) > 1;
    const chosen = seesOthers ? tenant : null;
    const showsOwn = chosen === null || chosen === summary?.own_tenant;
    const totals = useMemo(() => summary && totalsOf(summary, chosen), [summary, chosen]);
    const shown = useMemo(() => inOrder((jobs ?? []).filter(filters[filter]![1])), [jobs, filter]);
    const isEmpty = jobs?.length === 0 && !seesOthers;

    return (
        <>
            <div class="heading">
                <h1 tabIndex={-1}>Queue</h1>
                <LinkState link={link} />
                <a class="button primary" href="/new">
                    New job
                </a>
            </div>
            {seesOthers && <TenantChips summary={summary!} chosen={chosen} choose={setTenant} />}
            {isEmpty ? (
                <EmptyQueue />
            ) : (
                <>
                    <Tiles totals={totals} workers={props.capabilities?.workers} seconds={showsOwn ? meanSeconds(jobs ?? []) : null} now={now} />
                    {totals && <Throughput totals={totals} />}
                    {seesOthers && chosen === null && <TenantTable summary={summary!} now={now} choose={setTenant} />}
                    {showsOwn ? (
                        <>
                            <div class="chips" role="group" aria-label="Show jobs">
                                {filters.map(([label, matches], index) => (
                                    <button key={label} aria-pressed={index === filter} onClick={() => setFilter(index)}>
                                        {label} <small>{`${(jobs ?? []).filter(matches).length}${hasMore ? '+' : ''}`}</small>
                                    </button>
                                ))}
                                {seesOthers && <span class="hint">of {summary!.own_tenant}, your tenant</span>}
                            </div>
                            <JobTable jobs={shown} now={now} nothing={jobs ? 'No such jobs.' : 'Loading…'} />
                            {hasMore && (
                                <p class="older">
                                    <button onClick={showOlder}>Show older jobs</button>
                                </p>
                            )}
                        </>
                    ) : (
                        <p class="hint walls">
                            An operator sees the numbers of {chosen}. Its jobs, files and labels are for those who have its token.
                        </p>
                    )}
                </>
            )}
        </>
    );
}

function JobTable(props: { jobs: Job[]; now: number; nothing: string }) {
    return (
        <div class="card table-card">
            <table class="jobs">
                <caption class="sr">Jobs: those that run, those that wait, those that ended</caption>
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
                    {props.jobs.map((job) => (
                        <Row key={job.name} job={job} now={props.now} />
                    ))}
                </tbody>
            </table>
            {props.jobs.length === 0 && <p class="nothing">{props.nothing}</p>}
        </div>
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

/** Of the last jobs that were run. */
function meanSeconds(jobs: Job[]): number | null {
    const seconds = jobs
        .filter((job) => job.state === 'STATE_SUCCEEDED' && job.end_time && job.start_time && (job.attempt ?? 0) > 0)
        .slice(0, 20)
        .map((job) => (Date.parse(job.end_time!) - Date.parse(job.start_time!)) / 1000);
    return seconds.length ? total(seconds) / seconds.length : null;
}

function Tiles(props: { totals: Totals | null; workers?: number | undefined; seconds: number | null; now: number }) {
    const { totals, workers } = props;
    const failed = totals ? total(totals.failed) : 0;
    return (
        <dl class="tiles">
            <div>
                <dt>Running</dt>
                <dd>
                    {totals?.running ?? '–'}
                    {workers !== undefined && <small>{` on ${workers} ${workers === 1 ? 'worker' : 'workers'}`}</small>}
                </dd>
            </div>
            <div>
                <dt>Waiting</dt>
                <dd>
                    {totals?.waiting ?? '–'}
                    {totals?.oldestQueued && <small>{` the oldest ${brief((props.now - totals.oldestQueued) / 1000)}`}</small>}
                </dd>
            </div>
            <div>
                <dt>Succeeded in the last hour</dt>
                <dd>
                    {totals ? total(totals.succeeded) : '–'}
                    {failed > 0 && <small>{` and ${failed} failed`}</small>}
                </dd>
            </div>
            <div>
                <dt>Mean time of a job</dt>
                <dd>{props.seconds === null ? '–' : duration(props.seconds)}</dd>
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

/** How often jobs beyond the live page are asked for again while some of them aren't over. */
const olderEvery = 5_000;

function useQueue() {
    const [page, setPage] = useState<JobList | null>(null);
    const [summary, setSummary] = useState<QueueSummary | null>(null);
    const [link, setLink] = useState<Link>('connecting');
    useEffect(
        () =>
            follow({
                url: () => '/api/v1/events',
                events: {
                    jobs: (data) => setPage(JSON.parse(data)),
                    summary: (data) => setSummary(JSON.parse(data)),
                },
                onLink: setLink,
                onRefused: (status) => status === 401 && signedOut(),
            }),
        [],
    );
    const { older, hasOlder, showOlder } = useOlder(page);
    const jobs = useMemo(() => {
        const names = new Set(page?.jobs?.map((job) => job.name));
        return page && [...(page.jobs ?? []), ...older.filter((job) => !names.has(job.name))];
    }, [page, older]);
    return { jobs, summary, hasMore: hasOlder, showOlder, link };
}

/** The jobs that come after the page that is live, as many pages of them as were asked for. */
function useOlder(page: JobList | null) {
    const [older, setOlder] = useState<Job[]>([]);
    const [next, setNext] = useState('');
    const [pages, setPages] = useState(0);
    const first = useRef('');
    first.current = page?.next_page_token ?? '';
    useEffect(() => {
        let timer: ReturnType<typeof setTimeout> | undefined;
        let isStopped = false;
        const load = async () => {
            const jobs: Job[] = [];
            let token = first.current;
            for (let i = 0; i < pages && token; ++i) {
                const list = await api.olderJobs(token);
                jobs.push(...(list.jobs ?? []));
                token = list.next_page_token ?? '';
            }
            if (!isStopped) {
                setOlder(jobs);
                setNext(token);
                if (jobs.some((job) => !terminalStates.has(job.state))) {
                    timer = setTimeout(() => load().catch(() => {}), olderEvery);
                }
            }
        };
        if (pages > 0) {
            load().catch(() => {}); // A server that is away is told by the live page.
        }
        return () => {
            isStopped = true;
            clearTimeout(timer);
        };
    }, [pages, first.current]);
    const hasOlder = pages === 0 ? first.current !== '' : next !== '';
    return { older, hasOlder, showOlder: () => setPages(pages + 1) };
}

export function useNow(): number {
    const [now, setNow] = useState(Date.now());
    useEffect(() => {
        const timer = setInterval(() => setNow(Date.now()), 1000);
        return () => clearInterval(timer);
    }, []);
    return now;
}
