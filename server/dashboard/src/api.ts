// The messages of remesh.v1 as the server writes them in JSON: names as in the proto files, 64-bit
// numbers as text, defaults left out.

export interface Digest {
    sha256: string;
    size_bytes?: string;
}

export interface Histogram {
    low?: number;
    high?: number;
    counts?: string[];
}

export interface Summary {
    count?: string;
    min?: number;
    first_percentile?: number;
    mean?: number;
    max?: number;
    histogram?: Histogram;
}

export interface SurfaceQuality {
    vertices?: string;
    triangles?: string;
    components?: string;
    euler_characteristic?: string;
    area?: number;
    volume?: number;
    radius_ratio?: Summary;
    min_angle?: Summary;
    edge_length?: Summary;
}

export interface TetQuality {
    tets?: string;
    volume?: number;
    radius_ratio?: Summary;
    dihedral?: Summary;
}

export interface Deviation {
    max?: number;
    p99?: number;
    rms?: number;
}

export interface Defect {
    code: string;
    description?: string;
    count?: string;
    at?: number[];
}

export interface Quality {
    edge_length?: number;
    before?: SurfaceQuality;
    after?: SurfaceQuality;
    tets?: TetQuality;
    output_to_input?: Deviation;
    input_to_output?: Deviation;
    volume_change?: number;
    defects?: Defect[];
}

export interface Output {
    kind: string;
    format?: string;
    digest: Digest;
    file_name?: string;
}

export interface Progress {
    stage?: string;
    stage_fraction?: number;
    fraction?: number;
}

/** What coordinates mean. */
export interface Frame {
    unit?: string;
    space?: string;
}

export interface Job {
    name: string;
    etag?: string;
    state: string;
    spec: {
        input: { digest: Digest; format?: string; file_name?: string; frame?: Frame };
        options?: object;
        outputs?: { format: string; content?: string }[];
        priority?: number;
        timeout?: string;
        labels?: Record<string, string>;
    };
    attempt?: number;
    max_attempts?: number;
    queue_position?: number;
    estimated_start_time?: string;
    /** The job that this one repeats. */
    origin?: string;
    progress?: Progress;
    create_time: string;
    start_time?: string;
    end_time?: string;
    failure?: { reason?: string; message?: string; retryable?: boolean; stage?: string; outputs?: Output[] };
    result?: {
        outputs?: Output[];
        quality?: Quality;
        provenance?: { engine_version?: string; options?: object; input?: Digest };
    };
}

export interface Sample {
    stage?: string;
    iteration: number;
    simulated_time?: number;
    kinetic_energy?: number;
    potential_energy?: number;
    max_displacement?: number;
    rms_displacement?: number;
    residual_force?: number;
    particles?: string;
    surface_particles?: string;
    quality?: { mean?: number; first_percentile?: number; histogram?: Histogram };
}

export interface Warning {
    code: string;
    message?: string;
}

export interface JobEvent {
    sequence?: string;
    time: string;
    skipped_events?: string;
    snapshot?: Job;
    progress?: Progress;
    sample?: Sample;
    warning?: Warning;
    preview?: { digest: Digest; iteration?: number };
    completed?: Job;
}

/** A tenant's jobs in numbers; lists have one for each interval. */
export interface TenantSummary {
    tenant: string;
    queued?: number;
    running?: number;
    oldest_queued_time?: string;
    succeeded: number[];
    failed: number[];
    cancelled: number[];
    tets: string[];
}

export interface QueueSummary {
    tenants: TenantSummary[];
    start_time: string;
    own_tenant: string;
}

export interface JobList {
    jobs?: Job[];
    next_page_token?: string;
}

export interface Capabilities {
    server_version: string;
    formats: {
        format: string;
        extension: string;
        can_read?: boolean;
        can_write_surface?: boolean;
        can_write_tetrahedra?: boolean;
    }[];
    max_artifact_bytes?: string;
    workers?: number;
    max_queued_jobs?: number;
}

export const terminalStates = new Set([
    'STATE_SUCCEEDED',
    'STATE_FAILED',
    'STATE_CANCELLED',
    'STATE_QUARANTINED',
]);

/** What the server refused, in its own words. */
export class ApiError extends Error {
    constructor(
        readonly status: number,
        readonly reason: string,
        message: string,
        readonly fields: { field: string; description: string }[] = [],
    ) {
        super(message);
    }
}

type Listener = () => void;
let onSignedOut: Listener = () => {};

/** Called whenever the server asks for a token. */
export function setSignedOutListener(listener: Listener) {
    onSignedOut = listener;
}

export function signedOut() {
    onSignedOut();
}

async function errorOf(response: Response): Promise<ApiError> {
    if (response.status === 401) {
        onSignedOut();
    }
    try {
        const { error } = await response.json();
        return new ApiError(response.status, error.reason ?? '', error.message ?? response.statusText, error.fields);
    } catch {
        return new ApiError(response.status, '', response.statusText || `HTTP ${response.status}`);
    }
}

async function call<T>(method: string, path: string, body?: unknown): Promise<T> {
    const response = await fetch(`/api/v1/${path}`, {
        method,
        headers: { 'X-Remesh': '1', ...(body === undefined ? {} : { 'Content-Type': 'application/json' }) },
        body: body === undefined ? undefined : JSON.stringify(body),
    });
    if (!response.ok) {
        throw await errorOf(response);
    }
    return response.status === 204 ? (undefined as T) : response.json();
}

export const api = {
    capabilities: () => call<Capabilities>('GET', 'capabilities'),
    /** Jobs older than those of the page that came with the token. */
    olderJobs: (pageToken: string) => call<JobList>('GET', `jobs?page_token=${encodeURIComponent(pageToken)}`),
    job: (name: string) => call<Job>('GET', name),
    create: (request: object) => call<Job>('POST', 'jobs', request),
    cancel: (name: string) => call<Job>('POST', `${name}:cancel`),
    retry: (name: string, requestId: string) => call<Job>('POST', `${name}:retry`, { request_id: requestId }),
    remove: (name: string) => call<void>('DELETE', name),
    signIn: (token: string) => call<void>('POST', 'session', { token }),
    session: () => call<{ signed_in: boolean }>('GET', 'session'),
    signOut: () => call<void>('DELETE', 'session'),
};

/** The address of an artifact's bytes. */
export function artifactUrl(digest: Digest, name: string): string {
    return `/api/v1/artifacts/${digest.sha256}?name=${encodeURIComponent(name)}`;
}

/** The address of a page among the results, to be looked at. */
export function pageUrl(digest: Digest): string {
    return `/api/v1/artifacts/${digest.sha256}?view`;
}

export async function fetchArtifact(digest: Digest): Promise<ArrayBuffer> {
    const response = await fetch(`/api/v1/artifacts/${digest.sha256}`);
    if (!response.ok) {
        throw await errorOf(response);
    }
    return response.arrayBuffer();
}

async function digestOf(file: File): Promise<Digest> {
    if (!globalThis.crypto?.subtle) {
        throw new Error('This browser only computes checksums over HTTPS or on this machine: open the page by one of them.');
    }
    const hash = new Uint8Array(await crypto.subtle.digest('SHA-256', await file.arrayBuffer()));
    const sha256 = Array.from(hash, (byte) => byte.toString(16).padStart(2, '0')).join('');
    return { sha256, size_bytes: String(file.size) };
}

/** Uploads a file and names it. */
export async function upload(file: File, onProgress: (fraction: number) => void): Promise<Digest> {
    const digest = await digestOf(file);
    await new Promise<void>((resolve, reject) => {
        // fetch tells nothing of how far an upload is.
        const request = new XMLHttpRequest();
        request.open('PUT', `/api/v1/artifacts/${digest.sha256}`);
        request.setRequestHeader('X-Remesh', '1');
        request.upload.onprogress = (event) => onProgress(event.loaded / Math.max(1, event.total));
        request.onerror = () => reject(new Error('The upload was interrupted.'));
        request.onload = async () => {
            if (request.status < 300) {
                resolve();
            } else {
                reject(await errorOf(new Response(request.responseText, { status: request.status })));
            }
        };
        request.send(file);
    });
    return digest;
}
