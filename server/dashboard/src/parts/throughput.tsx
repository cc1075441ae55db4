import { useEffect, useRef, useState } from 'preact/hooks';
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';

import { compact, count, moment, number } from '../format';
import { perSecond, total, type Totals } from '../queue_model';
import { colour, onThemeChange } from '../theme';

interface Layer {
    label: string;
    ink: string;
    values: number[];
    /** What the legend says of it. */
    sum: string;
}

/** What was done in the last hour, minute by minute. */
export function Throughput(props: { totals: Totals }) {
    const { totals } = props;
    const rates = perSecond(totals.tets);
    const ended = total(totals.succeeded) + total(totals.failed) + total(totals.cancelled);
    const layer = (label: string, ink: string, values: number[]): Layer => ({ label, ink, values, sum: count(total(values)) });
    return (
        <section class="card throughput" aria-labelledby="throughput-title">
            <h2 id="throughput-title">Throughput</h2>
            <span class="muted">{ended === 0 ? 'Nothing has ended within the last hour.' : 'The last hour, by the minute'}</span>
            {ended > 0 && (
                <>
                    <div class="curves">
                        <Columns
                            title="Jobs ended per minute"
                            times={totals.times}
                            layers={[
                                layer('succeeded', 'ink-1', totals.succeeded),
                                layer('failed', 'ink-2', totals.failed),
                                layer('cancelled', 'ink-before', totals.cancelled),
                            ]}
                        />
                        <Columns
                            title="Tetrahedra per second"
                            times={totals.times}
                            layers={[{ label: 'in the hour', ink: 'ink-1', values: rates, sum: count(total(totals.tets)) }]}
                        />
                    </div>
                    <Table totals={totals} rates={rates} />
                </>
            )}
        </section>
    );
}

const height = 118;

/** Columns over the time, one layer upon the other. */
function Columns(props: { title: string; times: number[]; layers: Layer[] }) {
    const place = useRef<HTMLDivElement>(null);
    const chart = useRef<uPlot | null>(null);
    const [look, setLook] = useState(0);
    const inks = props.layers.map((layer) => layer.ink).join();
    useEffect(() => onThemeChange(() => setLook((n) => n + 1)), []);
    useEffect(() => {
        const element = place.current!;
        chart.current = new uPlot(optionsOf(inks.split(','), element.clientWidth), [[], ...props.layers.map(() => [])], element);
        const observer = new ResizeObserver(() => chart.current?.setSize({ width: element.clientWidth, height }));
        observer.observe(element);
        return () => {
            observer.disconnect();
            chart.current?.destroy();
            chart.current = null;
        };
    }, [inks, look]);
    useEffect(() => {
        // The uppermost is drawn first, and all down to the axis: the others cover it.
        const heaps = props.layers.map((_, top) => props.times.map((_time, i) => total(props.layers.slice(0, top + 1).map((layer) => layer.values[i]!))));
        chart.current?.setData([props.times, ...heaps.toReversed()]);
    });
    return (
        <figure>
            <figcaption>
                <strong>{props.title}</strong>
                <ul class="legend" aria-label="Sums">
                    {props.layers.map((layer) => (
                        <li key={layer.label}>
                            <i class={`block ${layer.ink}`} aria-hidden="true" />
                            {layer.label} <b>{layer.sum}</b>
                        </li>
                    ))}
                </ul>
            </figcaption>
            <div ref={place} class="columns" aria-hidden="true" />
        </figure>
    );
}

function optionsOf(inks: string[], width: number): uPlot.Options {
    const axis: uPlot.Axis = {
        stroke: colour('muted'),
        font: `11px ${getComputedStyle(document.body).fontFamily}`,
        grid: { stroke: colour('line'), width: 1 },
        ticks: { show: false },
    };
    const bars = uPlot.paths.bars!({ size: [0.72, 40], align: 1 });
    const clock = (seconds: number) => moment(new Date(1000 * seconds).toISOString()).slice(11, 16);
    return {
        width,
        height,
        legend: { show: false },
        cursor: { show: false },
        padding: [8, 16, 0, 0],
        scales: {
            x: { time: true, range: (_u, low, high) => [low, high + 60] },
            y: { range: (_u, _low, high) => [0, Math.max(4, 1.08 * high)] },
        },
        axes: [
            { ...axis, size: 22, gap: 4, grid: { show: false }, incrs: [900], values: (_u, ticks) => ticks.map(clock) },
            { ...axis, size: 46, space: 22, incrs: [1, 2, 5].flatMap((n) => [0, 1, 2, 3, 4, 5, 6, 7].map((power) => n * 10 ** power)).sort((a, b) => a - b), values: (_u, ticks) => ticks.map(compact) },
        ],
        series: [
            {},
            ...inks.toReversed().map((ink): uPlot.Series => ({ fill: colour(ink), stroke: colour(ink), width: 0, paths: bars, points: { show: false } })),
        ],
    };
}

/** The same as numbers; minutes in which nothing ended are left out. */
function Table(props: { totals: Totals; rates: number[] }) {
    const { totals, rates } = props;
    const isBusy = (i: number) => totals.succeeded[i]! + totals.failed[i]! + totals.cancelled[i]! > 0;
    return (
        <details class="as-table">
            <summary>
                As a table<span class="sr">: Throughput</span>
            </summary>
            <div class="scroll" tabIndex={0} role="group" aria-label="Table: Throughput">
                <table>
                    <thead>
                        <tr>
                            <th scope="col">Minute</th>
                            {['Succeeded', 'Failed', 'Cancelled', 'Tets per second'].map((name) => (
                                <th key={name} scope="col" class="right">
                                    {name}
                                </th>
                            ))}
                        </tr>
                    </thead>
                    <tbody>
                        {totals.times.map((time, i) =>
                            isBusy(i) ? (
                                <tr key={time}>
                                    <td>{moment(new Date(1000 * time).toISOString()).slice(0, 16)}</td>
                                    {[totals.succeeded, totals.failed, totals.cancelled].map((list, column) => (
                                        <td key={column} class="right">
                                            {count(list[i])}
                                        </td>
                                    ))}
                                    <td class="right">{number(rates[i])}</td>
                                </tr>
                            ) : null,
                        )}
                    </tbody>
                </table>
            </div>
        </details>
    );
}
