// Repeats records of the pins (hdl/sim/src/trace.rs has their layout) with the Verilated core.
//
// Invariant: after every edge every output is what the record says; the first that is not ends it with status 1.

#include "Vnirspi_core.h"
#include "verilated.h"
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>

namespace {

constexpr int INPUTS = 1 << 3, OUTPUTS = 1 << 4;
constexpr uint32_t SAMPLING = 0x01280F11; // that of hdl/sim/src/pins.rs
enum Edge { ADC, HOST, ADC_RESET, HOST_RESET, BRIDGE_RESET, SCK, DESELECTED };

struct Outputs {
    uint32_t rows, columns, rest;
};

void drive(Vnirspi_core& core, uint32_t inputs) {
    core.adc_code = inputs & 0x3FFF;
    core.adc_over_range = inputs >> 14 & 1;
    core.interlock = inputs >> 15 & 1;
    core.spi_sck = inputs >> 16 & 1;
    core.spi_cs_n = inputs >> 17 & 1;
    core.spi_in = inputs >> 18 & 15;
    core.adc_beat = inputs >> 22 & 1;
    core.pll_locked = core.clock_alive = inputs >> 23 & 1;
    core.design_id = inputs >> 24 & 127;
    core.parallel_ready = inputs >> 31;
    core.sampling = SAMPLING;
}

// Inputs have settled before the clock rises, and outputs before it falls.
void clock(Vnirspi_core& core, int edge) {
    if (edge == DESELECTED) {
        core.rst_sck = 1;
        core.eval();
        core.rst_sck = 0;
        core.eval();
        return;
    }
    core.rst_adc = edge == ADC_RESET;
    core.rst_host = edge == HOST_RESET;
    core.rst_bridge = edge == BRIDGE_RESET;
    core.eval();
    CData& clock = edge == SCK ? core.clk_sck : edge == ADC || edge == ADC_RESET ? core.clk_adc : core.clk_host;
    clock = 1;
    core.eval();
    clock = 0;
    core.rst_adc = core.rst_host = core.rst_bridge = 0;
    core.eval();
}

Outputs outputs(const Vnirspi_core& core) {
    const uint32_t flags = core.led_enable | core.frame_ready << 1 | core.raw_ready << 2 | core.access << 3;
    const uint32_t parallel = core.parallel_lines | core.parallel_enable << 8 | core.parallel_strobe << 9;
    return {core.led_rows, core.led_columns, flags | core.spi_out << 4 | core.spi_drive << 8 | parallel << 12};
}

bool same(const Outputs& a, const Outputs& b) {
    return a.rows == b.rows && a.columns == b.columns && a.rest == b.rest;
}

// Edges in the record.
uint64_t repeat(const char* path) {
    std::unique_ptr<FILE, int (*)(FILE*)> file{std::fopen(path, "rb"), std::fclose};
    if (!file) {
        std::fprintf(stderr, "%s: cannot be read\n", path);
        std::exit(2);
    }
    VerilatedContext context;
    Vnirspi_core core{&context};
    uint32_t inputs = 0;
    Outputs expected{};
    uint64_t edges = 0;
    const auto fill = [&](void* to, size_t bytes) {
        if (std::fread(to, bytes, 1, file.get()) != 1) {
            std::fprintf(stderr, "%s: ends within edge %llu\n", path, (unsigned long long)edges);
            std::exit(2);
        }
    };
    for (int head; (head = std::fgetc(file.get())) != EOF; ++edges) {
        if (head & INPUTS) fill(&inputs, sizeof inputs);
        if (head & OUTPUTS) fill(&expected, sizeof expected);
        drive(core, inputs);
        clock(core, head & 7);
        const Outputs found = outputs(core);
        if (!same(found, expected)) {
            std::fprintf(stderr,
                         "%s: edge %llu: rows, columns, rest %08x %08x %03x, recorded %08x %08x %03x\n", path,
                         (unsigned long long)edges, found.rows, found.columns, found.rest, expected.rows,
                         expected.columns, expected.rest);
            std::exit(1);
        }
    }
    core.final();
    return edges;
}

}  // namespace

int main(int count, char** paths) {
    uint64_t edges = 0;
    for (int i = 1; i < count; ++i) edges += repeat(paths[i]);
    std::printf("%llu edges in %d records: every output as recorded\n", (unsigned long long)edges, count - 1);
    return edges == 0 ? 2 : 0;
}
