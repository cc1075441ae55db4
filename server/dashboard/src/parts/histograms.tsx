import type { Histogram, Quality, Summary } from '../api';
import { count, number, percent } from '../format';

interface Panel {
    title: string;
    unit: string;
    before?: Summary;
    after?: Summary;
    afterLabel: string;
}

/** Distributions before and after, side by side, on one scale. */
export function Histograms(props: { quality: Quality }) {
    const { quality } = props;
    const panels: Panel[] = [
        {
            title: 'Triangles: radius ratio',
            unit: '0 degenerate, 1 regular',
            before: quality.before?.radius_ratio,
            after: quality.after?.radius_ratio,
            afterLabel: 'after',
        },
        {
            title: 'Triangles: smallest angle',
            unit: 'degrees',
            before: quality.before?.min_angle,
            after: quality.after?.min_angle,
            afterLabel: 'after',
        },
    ];
    if (quality.tets) {
        panels.push(
            {
                title: 'Tetrahedra: radius ratio',
                unit: '0 flat, 1 regular',
                after: quality.tets.radius_ratio,
                afterLabel: 'result',
            },
            {
                title: 'Tetrahedra: dihedral angles',
                unit: 'degrees',
                after: quality.tets.dihedral,
                afterLabel: 'result',
            },
        );
    }
    return (
        <section aria-labelledby="histograms-title">
            <div class="section-title">
                <h2 id="histograms-title">Quality</h2>
            </div>
            <div class="histograms">
                {panels.map((panel) => (
                    <HistogramPanel key={panel.title} panel={panel} />
                ))}
            </div>
        </section>
    );
}

function HistogramPanel(props: { panel: Panel }) {
    const { panel } = props;
    const top = Math.max(highest(panel.before?.histogram), highest(panel.after?.histogram));
    return (
        <figure class="card">
            <figcaption>
                <strong>{panel.title}</strong> <small>{panel.unit}</small>
            </figcaption>
            <div class="pair">
                {panel.before && (
                    <Bars label="before" ink="ink-before" summary={panel.before} top={top} width={half} />
                )}
                {panel.after && (
                    <Bars
                        label={panel.afterLabel}
                        ink="ink-1"
                        summary={panel.after}
                        top={top}
                        width={panel.before ? half : 2 * half}
                    />
                )}
            </div>
            <HistogramTable panel={panel} />
        </figure>
    );
}

const half = 250;
const height = 110;

function Bars(props: { label: string; ink: string; summary: Summary; top: number; width: number }) {
    const { width } = props;
    const shares = sharesOf(props.summary.histogram);
    const low = props.summary.histogram?.low ?? 0;
    const high = props.summary.histogram?.high ?? 1;
    const step = width / Math.max(1, shares.length);
    const mean = (width * ((props.summary.mean ?? 0) - low)) / (high - low || 1);
    return (
        <div>
            <svg
                class="bars"
                viewBox={`0 0 ${width} ${height + 16}`}
                role="img"
                aria-label={`${props.label}: mean ${number(props.summary.mean)}, smallest ${number(props.summary.min)}, ${count(props.summary.count)} elements`}
            >
                {shares.map((share, i) => {
                    const tall = (height * share) / (props.top || 1);
                    return <rect key={i} class={props.ink} x={i * step + 0.75} y={height - tall} width={step - 1.5} height={tall} rx="1" />;
                })}
                <line class="axis" x1="0" x2={width} y1={height + 0.5} y2={height + 0.5} />
                <line class="mean" x1={mean} x2={mean} y1="0" y2={height} />
                <text x="0" y={height + 13}>
                    {number(low)}
                </text>
                <text x={width} y={height + 13} text-anchor="end">
                    {number(high)}
                </text>
            </svg>
            <p class="bars-label">
                <strong>{props.label}</strong> mean {number(props.summary.mean)} · worst {number(props.summary.min)} ·{' '}
                {count(props.summary.count)}
            </p>
        </div>
    );
}

function HistogramTable(props: { panel: Panel }) {
    const { before, after } = props.panel;
    const histogram = after?.histogram ?? before?.histogram;
    const bins = histogram?.counts?.length ?? 0;
    const low = histogram?.low ?? 0;
    const step = ((histogram?.high ?? 1) - low) / Math.max(1, bins);
    const beforeShares = sharesOf(before?.histogram);
    const afterShares = sharesOf(after?.histogram);
    return (
        <details class="as-table">
            <summary>
                As a table<span class="sr">: {props.panel.title}</span>
            </summary>
            <div class="scroll" tabIndex={0} role="group" aria-label={`Table: ${props.panel.title}`}>
                <table>
                    <thead>
                        <tr>
                            <th scope="col">From</th>
                            <th scope="col">To</th>
                            {before && (
                                <th scope="col" class="right">
                                    before
                                </th>
                            )}
                            <th scope="col" class="right">
                                {props.panel.afterLabel}
                            </th>
                        </tr>
                    </thead>
                    <tbody>
                        {Array.from({ length: bins }, (_, i) => (
                            <tr key={i}>
                                <td>{number(low + i * step)}</td>
                                <td>{number(low + (i + 1) * step)}</td>
                                {before && <td class="right">{percent(beforeShares[i])}</td>}
                                <td class="right">{percent(afterShares[i])}</td>
                            </tr>
                        ))}
                    </tbody>
                </table>
            </div>
        </details>
    );
}

function sharesOf(histogram: Histogram | undefined): number[] {
    const counts = (histogram?.counts ?? []).map(Number);
    const total = counts.reduce((a, b) => a + b, 0) || 1;
    return counts.map((value) => value / total);
}

function highest(histogram: Histogram | undefined): number {
    return Math.max(0, ...sharesOf(histogram));
}
