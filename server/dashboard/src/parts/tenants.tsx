import type { QueueSummary } from '../api';
import { brief, compact, count } from '../format';
import { total, totalsOf } from '../queue_model';

/** Whose jobs the page tells of; for those who may see more than one tenant. */
export function TenantChips(props: { summary: QueueSummary; chosen: string | null; choose: (tenant: string | null) => void }) {
    const { summary, chosen } = props;
    return (
        <div class="chips tenants" role="group" aria-label="Show tenants">
            <button aria-pressed={chosen === null} onClick={() => props.choose(null)}>
                All tenants
            </button>
            {summary.tenants.map(({ tenant }) => (
                <button key={tenant} aria-pressed={chosen === tenant} onClick={() => props.choose(tenant)}>
                    {tenant}
                    {tenant === summary.own_tenant && <small>yours</small>}
                </button>
            ))}
        </div>
    );
}

/** How the tenants share the server. */
export function TenantTable(props: { summary: QueueSummary; now: number; choose: (tenant: string) => void }) {
    const { summary, now } = props;
    return (
        <div class="card table-card">
            <table class="by-tenant">
                <caption class="sr">Tenants</caption>
                <thead>
                    <tr>
                        <th scope="col">Tenant</th>
                        {['Running', 'Waiting', 'Longest wait', 'Succeeded in 1 h', 'Failed in 1 h', 'Tets in 1 h'].map((name) => (
                            <th key={name} scope="col" class="right">
                                {name}
                            </th>
                        ))}
                    </tr>
                </thead>
                <tbody>
                    {summary.tenants.map(({ tenant }) => {
                        const totals = totalsOf(summary, tenant);
                        const wait = totals.oldestQueued === null ? '–' : brief((now - totals.oldestQueued) / 1000);
                        const cells: [string, string][] = [
                            ['Running', count(totals.running)],
                            ['Waiting', count(totals.waiting)],
                            ['Longest wait', wait],
                            ['Succeeded in 1 h', count(total(totals.succeeded))],
                            ['Failed in 1 h', count(total(totals.failed))],
                            ['Tets in 1 h', compact(total(totals.tets))],
                        ];
                        return (
                            <tr key={tenant}>
                                <th scope="row">
                                    <button class="link-button" onClick={() => props.choose(tenant)}>
                                        {tenant}
                                    </button>
                                </th>
                                {cells.map(([name, value]) => (
                                    <td key={name} data-label={name} class="right">
                                        {value}
                                    </td>
                                ))}
                            </tr>
                        );
                    })}
                </tbody>
            </table>
        </div>
    );
}
