// What the queue's page knows: the jobs that are shown, and all of them in numbers.

import { terminalStates, type Job, type QueueSummary, type TenantSummary } from './api';

const rank = (job: Job) => (job.state === 'STATE_QUEUED' ? 1 : terminalStates.has(job.state) ? 2 : 0);
const newestFirst = (a: string | undefined, b: string | undefined) => Date.parse(b ?? '') - Date.parse(a ?? '');

/** Those that run, those that wait as they will start, those that ended, the last one first. */
export function inOrder(jobs: Job[]): Job[] {
    return jobs.toSorted((a, b) => {
        const ranks = rank(a) - rank(b);
        if (ranks !== 0) {
            return ranks;
        }
        return rank(a) === 1
            ? (a.queue_position ?? 0) - (b.queue_position ?? 0)
            : newestFirst(a.end_time ?? a.start_time, b.end_time ?? b.start_time) || newestFirst(a.create_time, b.create_time);
    });
}

export interface Totals {
    running: number;
    waiting: number;
    oldestQueued: number | null;
    /** Start of each interval, in seconds since 1970. */
    times: number[];
    succeeded: number[];
    failed: number[];
    cancelled: number[];
    tets: number[];
}

const interval = 60;

/** What some tenants add up to. */
export function totalsOf(summary: QueueSummary, tenant: string | null): Totals {
    const chosen = summary.tenants.filter((one) => tenant === null || one.tenant === tenant);
    const length = summary.tenants[0]?.succeeded.length ?? 0;
    const add = (list: (one: TenantSummary) => (number | string)[]) =>
        Array.from({ length }, (_, i) => chosen.reduce((sum, one) => sum + Number(list(one)[i] ?? 0), 0));
    const sum = (of: (one: TenantSummary) => number | undefined) => chosen.reduce((all, one) => all + (of(one) ?? 0), 0);
    const oldest = chosen.flatMap((one) => (one.oldest_queued_time ? [Date.parse(one.oldest_queued_time)] : []));
    const start = Date.parse(summary.start_time) / 1000;
    return {
        running: sum((one) => one.running),
        waiting: sum((one) => one.queued),
        oldestQueued: oldest.length ? Math.min(...oldest) : null,
        times: Array.from({ length }, (_, i) => start + i * interval),
        succeeded: add((one) => one.succeeded),
        failed: add((one) => one.failed),
        cancelled: add((one) => one.cancelled),
        tets: add((one) => one.tets),
    };
}

export const total = (list: number[]) => list.reduce((a, b) => a + b, 0);
/** Tets of each interval as a rate. */
export const perSecond = (tets: number[]) => tets.map((n) => n / interval);
