import type { Deviation, Frame, Job, Quality, Summary, SurfaceQuality } from '../api';
import { count, lengthsIn, moment, number, percent, ratio, spaceName, unitSign, word } from '../format';
import { jobPath } from '../router';

interface Table {
    title: string;
    columns: string[];
    rows: [name: string, ...values: string[]][];
}

const degrees = (value: number | undefined) => `${number(value ?? 0)}°`;

/** The measures of the paper and the ones that solvers ask for. */
export function Measures(props: { quality: Quality; frame: Frame | undefined }) {
    const sign = unitSign(props.frame);
    return (
        <section aria-labelledby="measures-title">
            <div class="section-title">
                <h2 id="measures-title">Measures</h2>
                <span class="muted">
                    {lengthsIn(props.frame)}; h is the edge length, {lengthOf(props.quality.edge_length, sign)}
                </span>
            </div>
            <div class="measures">
                {tablesOf(props.quality, sign).map((table) => (
                    <MeasureTable key={table.title} table={table} />
                ))}
            </div>
        </section>
    );
}

function lengthOf(value: number | undefined, sign: string): string {
    return `${number(value)}${sign && ` ${sign}`}`;
}

function tablesOf(quality: Quality, sign: string): Table[] {
    const { before, after, tets } = quality;
    // What an open surface encloses is a matter of taste.
    const isOpen = (quality.defects ?? []).some((defect) => defect.code === 'OPEN_BOUNDARY');
    const both = (show: (surface: SurfaceQuality | undefined) => string): [string, string] => [show(before), show(after)];
    const change = quality.volume_change ?? 0;
    const tables: Table[] = [
        {
            title: 'Body',
            columns: ['before', 'after'],
            rows: [
                ['Area', ...both((surface) => number(surface?.area, 4) + (sign && ` ${sign}²`))],
                ['Enclosed volume', isOpen ? 'open' : volumeOf(before?.volume, sign), volumeOf(after?.volume, sign)],
                [`Change of volume${isOpen ? ', once closed' : ''}`, '', `${change > 0 ? '+' : ''}${percent(change, 2)}`],
                ['Parts', ...both((surface) => count(surface?.components))],
                ['Euler characteristic', ...both((surface) => count(surface?.euler_characteristic))],
            ],
        },
        {
            title: 'Triangles',
            columns: ['before', 'after'],
            rows: [
                ['Number', ...both((surface) => count(surface?.triangles))],
                ...shapeRows('Radius ratio', before?.radius_ratio, after?.radius_ratio),
                ['Smallest angle', ...both((surface) => degrees(surface?.min_angle?.min))],
                ['Mean edge length', ...both((surface) => lengthOf(surface?.edge_length?.mean, sign))],
            ],
        },
    ];
    if (tets) {
        tables.push({
            title: 'Tetrahedra',
            columns: ['after'],
            rows: [
                ['Number', count(tets.tets)],
                ['Radius ratio, mean', ratio(tets.radius_ratio?.mean)],
                ['Radius ratio, worst 1 % below', ratio(tets.radius_ratio?.first_percentile)],
                ['Radius ratio, worst', ratio(tets.radius_ratio?.min ?? 0)],
                ['Dihedral angles', `${degrees(tets.dihedral?.min)} to ${degrees(tets.dihedral?.max)}`],
            ],
        });
    }
    const { output_to_input: there, input_to_output: back } = quality;
    const distance = (name: string, of: (deviation: Deviation) => number | undefined): Table['rows'][number] => [
        name,
        ...[there, back].map((deviation) => distanceOf(deviation && of(deviation), quality.edge_length, sign)),
    ];
    tables.push({
        title: 'Distance',
        columns: ['result to input', 'input to result'],
        rows: [
            distance('Root mean square', (deviation) => deviation.rms),
            distance('99 % are nearer than', (deviation) => deviation.p99),
            distance('Largest', (deviation) => deviation.max),
        ],
    });
    return tables;
}

function volumeOf(value: number | undefined, sign: string): string {
    return number(value, 4) + (sign && ` ${sign}³`);
}

function distanceOf(value: number | undefined, h: number | undefined, sign: string): string {
    if (value === undefined || !h) {
        return '–';
    }
    return `${lengthOf(value, sign)} (${(value / h).toFixed(2)} h)`;
}

function shapeRows(name: string, before: Summary | undefined, after: Summary | undefined): Table['rows'] {
    return [
        [`${name}, mean`, ratio(before?.mean), ratio(after?.mean)],
        [`${name}, worst 1 % below`, ratio(before?.first_percentile ?? 0), ratio(after?.first_percentile ?? 0)],
        [`${name}, worst`, ratio(before?.min ?? 0), ratio(after?.min ?? 0)],
    ];
}

function MeasureTable(props: { table: Table }) {
    const { table } = props;
    return (
        <div class="card scroll" tabIndex={0} role="group" aria-label={table.title}>
            <table>
                <thead>
                    <tr>
                        <th scope="col">{table.title}</th>
                        {table.columns.map((column) => (
                            <th key={column} scope="col" class="right">
                                {column}
                            </th>
                        ))}
                    </tr>
                </thead>
                <tbody>
                    {table.rows.map(([name, ...values]) => (
                        <tr key={name}>
                            <th scope="row">{name}</th>
                            {values.map((value, i) => (
                                <td key={i} class="right">
                                    {value}
                                </td>
                            ))}
                        </tr>
                    ))}
                </tbody>
            </table>
        </div>
    );
}

/** How it was made: enough to make it again. */
export function Made(props: { job: Job }) {
    const { job } = props;
    const provenance = job.result?.provenance;
    const rows: [string, string][] = [
        ['Job', job.name],
        ['Created', moment(job.create_time)],
        ['Input, SHA-256', job.spec.input.digest?.sha256 ?? ''],
        ['Unit of the input', word(job.spec.input.frame?.unit).replace('meter', 'metre') || 'not said'],
        ['Space of the input', spaceName(job.spec.input.frame) || 'not said'],
    ];
    if (job.origin) {
        rows.push(['Repeats', job.origin]);
    }
    if (provenance) {
        rows.push(['Engine', provenance.engine_version ?? '']);
    }
    return (
        <section aria-labelledby="made-title">
            <div class="section-title">
                <h2 id="made-title">Provenance</h2>
            </div>
            <div class="card made">
                <dl>
                    {rows.map(([name, value]) => (
                        <div key={name}>
                            <dt>{name}</dt>
                            <dd>{name === 'Repeats' ? <a href={jobPath(value)}>{value}</a> : value}</dd>
                        </div>
                    ))}
                </dl>
                <details>
                    <summary>{provenance ? 'Options, defaults filled in' : 'Options asked for'}</summary>
                    <pre tabIndex={0}>{JSON.stringify(provenance?.options ?? job.spec.options ?? {}, null, 2)}</pre>
                </details>
            </div>
        </section>
    );
}
