/* Casts rays from files against triangles with Embree's own interface in C, on command: the other side of
 * `benches/open3d/bench.py --embree`.
 *
 *     cc -O3 -march=native -o caster caster.c -lembree3 -lpthread -lm      (or -lembree4)
 *     caster MESH [packets|single] [robust]
 *
 * MESH is u64 v, u64 t, v vertices of three f32, and t triangles of three u32, little-endian. It speaks the lines of
 * benches/caster.rs: `rays FILE`, `cast N`, `hits FILE`. `packets` are 16 neighbouring rays each, cast as coherent ones with
 * rtcIntersect16; `single` is rtcIntersect1. The scene has the quality RTC_BUILD_QUALITY_MEDIUM, which is Embree's default,
 * and RTC_SCENE_FLAG_ROBUST if it is asked for. As there, reading the rays is in the time, and hits are written in full (depth,
 * u, v, normal, ids), 2,048 at a time, into memory that is used again.
 */

#define _GNU_SOURCE
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#define PACKET 16
#define ITEM 2048
#define LEAST_S 0.2

static RTCScene scene;
static int packets = 1;
/* Rays as they are read: directions, and one origin or one for each. */
static uint64_t rays, origins;
static float *direction, *origin;

static void fail(const char *why) {
    fprintf(stderr, "%s\n", why);
    exit(1);
}

static void *room(size_t bytes) {
    void *memory = aligned_alloc(64, (bytes + 63) / 64 * 64);
    return memory ? memory : (fail("no memory"), NULL);
}

static void *read_all(const char *path, size_t *bytes) {
    FILE *file = fopen(path, "rb");
    if (!file) fail(path);
    fseek(file, 0, SEEK_END);
    *bytes = (size_t)ftell(file);
    rewind(file);
    void *content = room(*bytes);
    if (fread(content, 1, *bytes, file) != *bytes) fail(path);
    fclose(file);
    return content;
}

static double seconds(clockid_t clock) {
    struct timespec now;
    clock_gettime(clock, &now);
    return now.tv_sec + 1e-9 * now.tv_nsec;
}

static void build(const char *path, int is_robust) {
    size_t bytes;
    char *content = read_all(path, &bytes);
    uint64_t vertices, triangles;
    memcpy(&vertices, content, 8);
    memcpy(&triangles, content + 8, 8);
    double begun = seconds(CLOCK_MONOTONIC);
    RTCDevice device = rtcNewDevice(NULL);
    if (!device) fail("Embree gives no device");
    scene = rtcNewScene(device);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_MEDIUM);
    rtcSetSceneFlags(scene, is_robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void *v = rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, vertices);
    void *t = rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, triangles);
    memcpy(v, content + 16, vertices * 12);
    memcpy(t, content + 16 + vertices * 12, triangles * 12);
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(scene, mesh);
    rtcReleaseGeometry(mesh);
    rtcCommitScene(scene);
    free(content);
    printf("{\"build_s\": %.6f, \"triangles\": %llu, \"version\": %d}\n", seconds(CLOCK_MONOTONIC) - begun,
           (unsigned long long)triangles, (int)rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION));
}

static void read_rays(const char *path) {
    size_t bytes;
    char *content = read_all(path, &bytes);
    memcpy(&rays, content, 8);
    memcpy(&origins, content + 8, 8);
    const double *numbers = (const double *)(content + 16);
    free(direction);
    free(origin);
    direction = room(rays * 12);
    origin = room(origins * 12);
    for (uint64_t i = 0; i < 3 * rays; i++) direction[i] = (float)numbers[i];
    for (uint64_t i = 0; i < 3 * origins; i++) origin[i] = (float)numbers[3 * rays + i];
    free(content);
    printf("{\"rays\": %llu}\n", (unsigned long long)rays);
}

static const float *origin_of(uint64_t ray) { return origin + (origins == 1 ? 0 : 3 * ray); }

static void intersect16(const int *valid, struct RTCRayHit16 *rayhit) {
#if RTC_VERSION_MAJOR >= 4
    struct RTCIntersectArguments arguments;
    rtcInitIntersectArguments(&arguments);
    arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
    rtcIntersect16(valid, scene, rayhit, &arguments);
#else
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcIntersect16(valid, scene, &context, rayhit);
#endif
}

static void intersect1(struct RTCRayHit *rayhit) {
#if RTC_VERSION_MAJOR >= 4
    struct RTCIntersectArguments arguments;
    rtcInitIntersectArguments(&arguments);
    rtcIntersect1(scene, rayhit, &arguments);
#else
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene, &context, rayhit);
#endif
}

/* Casts the packet of rays from `first` on, of which there are at least one. */
static void cast_packet(uint64_t first, struct RTCRayHit16 *hit) {
    int valid[PACKET] __attribute__((aligned(64)));
    for (int k = 0; k < PACKET; k++) {
        valid[k] = first + k < rays ? -1 : 0;
        uint64_t ray = valid[k] ? first + k : rays - 1;
        const float *o = origin_of(ray), *d = direction + 3 * ray;
        hit->ray.org_x[k] = o[0], hit->ray.org_y[k] = o[1], hit->ray.org_z[k] = o[2];
        hit->ray.dir_x[k] = d[0], hit->ray.dir_y[k] = d[1], hit->ray.dir_z[k] = d[2];
        hit->ray.tnear[k] = 0.0f, hit->ray.tfar[k] = INFINITY, hit->ray.time[k] = 0.0f;
        hit->ray.mask[k] = ~0u, hit->ray.id[k] = 0, hit->ray.flags[k] = 0;
        hit->hit.geomID[k] = hit->hit.primID[k] = RTC_INVALID_GEOMETRY_ID;
        hit->hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
    }
    intersect16(valid, hit);
}

static void cast_single(uint64_t ray, struct RTCRayHit *hit) {
    const float *o = origin_of(ray), *d = direction + 3 * ray;
    hit->ray.org_x = o[0], hit->ray.org_y = o[1], hit->ray.org_z = o[2];
    hit->ray.dir_x = d[0], hit->ray.dir_y = d[1], hit->ray.dir_z = d[2];
    hit->ray.tnear = 0.0f, hit->ray.tfar = INFINITY, hit->ray.time = 0.0f;
    hit->ray.mask = ~0u, hit->ray.id = 0, hit->ray.flags = 0;
    hit->hit.geomID = hit->hit.primID = RTC_INVALID_GEOMETRY_ID;
    hit->hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    intersect1(hit);
}

/* The memory of the hits of an item. */
static void *item_room(void) { return room(packets ? ITEM / PACKET * sizeof(struct RTCRayHit16) : ITEM * sizeof(struct RTCRayHit)); }

static void cast_item(uint64_t item, void *hits) {
    uint64_t end = (item + 1) * ITEM < rays ? (item + 1) * ITEM : rays;
    for (uint64_t ray = item * ITEM; ray < end; ray += packets ? PACKET : 1) {
        uint64_t at = ray - item * ITEM;
        if (packets) cast_packet(ray, (struct RTCRayHit16 *)hits + at / PACKET);
        else cast_single(ray, (struct RTCRayHit *)hits + at);
    }
}

static atomic_ullong next_item;

static void *work(void *nothing) {
    (void)nothing;
    void *hits = item_room();
    for (uint64_t items = (rays + ITEM - 1) / ITEM, item; (item = atomic_fetch_add(&next_item, 1)) < items;) cast_item(item, hits);
    free(hits);
    return NULL;
}

static void cast(int threads) {
    double wall = seconds(CLOCK_MONOTONIC), cpu = seconds(CLOCK_THREAD_CPUTIME_ID);
    int times = 0;
    do {
        atomic_store(&next_item, 0);
        pthread_t others[64];
        if (threads > 64) fail("at most 64 threads");
        for (int i = 1; i < threads; i++) pthread_create(&others[i], NULL, work, NULL);
        work(NULL);
        for (int i = 1; i < threads; i++) pthread_join(others[i], NULL);
        times++;
    } while (seconds(CLOCK_MONOTONIC) - wall < LEAST_S);
    printf("{\"cpu_s\": %.9f, \"wall_s\": %.9f}\n", (seconds(CLOCK_THREAD_CPUTIME_ID) - cpu) / times,
           (seconds(CLOCK_MONOTONIC) - wall) / times);
}

static void write_hits(const char *path) {
    double *t = room(rays * 8);
    uint32_t *id = room(rays * 4);
    void *hits = item_room();
    uint64_t count = 0;
    for (uint64_t item = 0; item * ITEM < rays; item++) {
        cast_item(item, hits);
        for (uint64_t k = 0; k < ITEM && item * ITEM + k < rays; k++) {
            struct RTCRayHit16 *packet = (struct RTCRayHit16 *)hits + k / PACKET;
            struct RTCRayHit *single = (struct RTCRayHit *)hits + k;
            uint64_t ray = item * ITEM + k;
            id[ray] = packets ? packet->hit.primID[k % PACKET] : single->hit.primID;
            float tfar = packets ? packet->ray.tfar[k % PACKET] : single->ray.tfar;
            t[ray] = id[ray] == RTC_INVALID_GEOMETRY_ID ? INFINITY : (double)tfar;
            count += id[ray] != RTC_INVALID_GEOMETRY_ID;
        }
    }
    FILE *file = fopen(path, "wb");
    if (!file || fwrite(t, 8, rays, file) != rays || fwrite(id, 4, rays, file) != rays || fclose(file)) fail(path);
    free(t), free(id), free(hits);
    printf("{\"hits\": %llu}\n", (unsigned long long)count);
}

int main(int count, char **words) {
    if (count < 2) fail("caster MESH [packets|single] [robust]");
    int is_robust = 0;
    for (int i = 2; i < count; i++) {
        if (!strcmp(words[i], "single")) packets = 0;
        if (!strcmp(words[i], "robust")) is_robust = 1;
    }
    build(words[1], is_robust);
    fflush(stdout);
    static char line[4096];
    while (fgets(line, sizeof line, stdin)) {
        line[strcspn(line, "\n")] = 0;
        char *argument = strchr(line, ' ');
        if (!argument) fail(line);
        *argument++ = 0;
        if (!strcmp(line, "rays")) read_rays(argument);
        else if (!strcmp(line, "cast")) cast(atoi(argument));
        else if (!strcmp(line, "hits")) write_hits(argument);
        else fail(line);
        fflush(stdout);
    }
    return 0;
}
