-- Wireshark dissector of nirspi's wire protocol, over TCP (port 1550, or "Decode As") and over USB bulk transfers.
--
-- Use it once:      wireshark -X lua_script:mcu/wire/wireshark/nirspi.lua
-- Install it:       copy it into Wireshark's folder of personal Lua plugins (Help, About, Folders).
-- Filters:          nirspi.message, nirspi.command, nirspi.outcome, nirspi.event, nirspi.sequence, nirspi.damaged ...
--
-- A packet is COBS(postcard(message) ++ CRC-32) ++ 0x00. The messages are those of mcu/wire/src/message.rs; the test
-- mcu/wire/tests/frozen/dissector.rs holds the lists of names below equal to it, and check.py beside this file runs the
-- dissector on a recording.

local PORT = 1550

local nirspi = Proto("nirspi", "nirspi camera")

-- Variants in the order of the enums of mcu/wire/src/message.rs.
local Command = { "Hello", "Configure", "Start", "Stop", "Status", "SelfTest", "ReadRegister", "LoadGateware", "RawBurst", "Reboot" }
local RunLength = { "Continuous", "Frames" }
local RebootInto = { "Application", "Bootloader" }
local SampleSource = { "Detector", "TestPattern" }
local PatternOrder = { "Natural", "Sequency", "Table" }
local DeviceMessage = { "Reply", "Frame", "Raw", "Depth", "Event", "Crash" }
local Answer = { "Hello", "Done", "Status", "SelfTest", "Register", "Gateware" }
local Refusal = { "Protocol", "State", "Configuration", "Fault", "NoSuchRegister", "RawLength", "GatewareOffset", "GatewareCrc", "Unsupported", "Bus", "Unknown" }
local ConfigProblem = { "OutOfRange", "OrderEntry" }
local ConfigField = { "Patterns", "ClocksPerPattern", "Blanked", "AdcLatency", "Sweeps", "OrderLength", "DutyPermille", "Frames" }
local State = { "Idle", "Configured", "Running", "Fault" }
local Fault = { "Interlock", "OverTemperature", "TemperatureSensor", "Duty", "OverRange", "FpgaWatchdog", "FpgaAbsent", "FpgaConfiguration", "FpgaStalled", "HostSilent", "BoardEnableStuck", "FpgaEnableStuck" }
local EventKind = { "Fault", "RunEnded", "RawDropped", "CommandDamaged", "FpgaAccessesDamaged" }

local fields = {
    damaged = ProtoField.string("nirspi.damaged", "Damaged"),
    crc = ProtoField.uint32("nirspi.crc", "CRC-32", base.HEX),
    id = ProtoField.uint16("nirspi.id", "Request"),
    command = ProtoField.string("nirspi.command", "Command"),
    message = ProtoField.string("nirspi.message", "Message"),
    outcome = ProtoField.string("nirspi.outcome", "Outcome"),
    event = ProtoField.string("nirspi.event", "Event"),
    fault = ProtoField.string("nirspi.fault", "Fault"),
    protocol = ProtoField.uint16("nirspi.protocol", "Protocol version"),
    run = ProtoField.uint16("nirspi.run", "Run"),
    sequence = ProtoField.uint32("nirspi.sequence", "Sequence"),
    samples = ProtoField.uint32("nirspi.samples", "Samples"),
    tail = ProtoField.bytes("nirspi.tail", "Bytes of a newer version"),
}
nirspi.fields = fields

-- A reader of postcard: every value is taken from the front of `view`, and is shown in `tree`.
local Reader = {}
Reader.__index = Reader

local function reader(view, tree)
    return setmetatable({ view = view, at = 0, tree = tree }, Reader)
end

function Reader:left()
    return self.view:len() - self.at
end

function Reader:take(length)
    if length > self:left() then error({ short = true }) end
    local range = self.view(self.at, length)
    self.at = self.at + length
    return range
end

-- An unsigned number of 7 bits a byte, least significant first. A number of 64 bits loses what a double cannot hold.
function Reader:varint()
    local from, value, scale = self.at, 0, 1
    repeat
        local byte = self:take(1):uint()
        value = value + (byte % 128) * scale
        scale = scale * 128
    until byte < 128
    return value, self.view(from, self.at - from)
end

function Reader:note(name, value, range)
    if fields[name] then
        self.tree:add(fields[name], range, value)
    else
        self.tree:add(range, name .. ": " .. tostring(value))
    end
    return value
end

function Reader:number(name)
    local value, range = self:varint()
    return self:note(name, value, range)
end

function Reader:byte(name)
    local range = self:take(1)
    return self:note(name, range:uint(), range)
end

function Reader:flag(name)
    local range = self:take(1)
    return self:note(name, range:uint() == 1 and "yes" or "no", range)
end

-- A signed number: 0, -1, 1, -2 ... are sent as 0, 1, 2, 3 ...
function Reader:signed(name)
    local value, range = self:varint()
    return self:note(name, value % 2 == 0 and value / 2 or -(value + 1) / 2, range)
end

function Reader:variant(name, names)
    local value, range = self:varint()
    return self:note(name, names[value + 1] or ("unknown (" .. value .. ")"), range), names[value + 1] ~= nil
end

function Reader:text(name)
    local length = self:varint()
    if length == 0 then return self:note(name, "", self.view(self.at - 1, 1)) end
    local range = self:take(length)
    return self:note(name, range:string(ENC_UTF_8), range)
end

-- Bytes in elements of `size` bytes; only their number is shown.
function Reader:block(name, size)
    local length, range = self:varint()
    if length > 0 then range = self:take(length) end
    return self:note(name, length / size, range)
end

function Reader:version(name)
    local range = self:take(3)
    return self:note(name, range(0, 1):uint() .. "." .. range(1, 1):uint() .. "." .. range(2, 1):uint(), range)
end

local function fault(r, name)
    local which = r:variant(name or "fault", Fault)
    if which == "OverTemperature" then
        r:signed("centi_celsius")
    elseif which == "FpgaAbsent" then
        r:number("identity")
    end
    return which
end

local commands = {
    Hello = function(r) r:number("protocol") end,
    Configure = function(r)
        if r:variant("order", PatternOrder) == "Table" then r:block("table entries", 2) end
        r:number("patterns")
        r:flag("differential")
        r:flag("alternating")
        r:number("clocks_per_pattern")
        r:number("blanked")
        r:byte("adc_latency")
        r:number("sweeps")
        r:variant("source", SampleSource)
        r:number("over_range_trip")
    end,
    Start = function(r)
        if r:variant("length", RunLength) == "Frames" then r:number("frames") end
    end,
    ReadRegister = function(r) r:number("address") end,
    LoadGateware = function(r)
        r:number("offset")
        r:number("total")
        r:number("crc of the bitstream")
        r:block("bytes", 1)
    end,
    RawBurst = function(r) r:number("samples asked for") end,
    Reboot = function(r) r:variant("into", RebootInto) end,
}

local answers = {
    Hello = function(r)
        r:number("protocol")
        r:version("firmware")
        r:version("gateware")
        r:text("board")
        r:text("serial")
        r:byte("side")
        r:number("adc_hz")
        r:byte("adc_bits")
        r:number("wavelength_nm")
        r:number("capabilities")
    end,
    Status = function(r)
        r:variant("state", State)
        if r:flag("fault stands") == "yes" then fault(r) end
        r:number("uptime_us")
        r:number("run")
        for _, name in ipairs({ "frames_made", "frames_sent", "frames_dropped", "fpga_frames_lost", "fpga_frames_corrupt", "commands_damaged" }) do
            r:number(name)
        end
        r:signed("temperature_centi_celsius")
        r:number("duty_permille")
        r:flag("leds_on")
        r:flag("interlock_closed")
        if r:flag("signal known") == "yes" then
            for _, name in ipairs({ "mean_milli_counts", "signal_milli_counts", "noise_milli_counts" }) do
                r:number(name)
            end
            r:signed("snr_centi_db")
            r:number("over_range_ppm")
        end
    end,
    SelfTest = function(r)
        r:number("checks that ran")
        r:number("checks that failed")
    end,
    Register = function(r) r:number("value") end,
    Gateware = function(r) r:number("next_offset") end,
}

local refusals = {
    Protocol = function(r) r:number("protocol") end,
    State = function(r) r:variant("state", State) end,
    Configuration = function(r)
        if r:variant("problem", ConfigProblem) == "OutOfRange" then
            r:variant("setting", ConfigField)
            r:number("found")
            r:number("min")
            r:number("max")
        else
            r:number("index")
            r:number("found")
        end
    end,
    Fault = function(r) fault(r) end,
    NoSuchRegister = function(r) r:number("address") end,
    RawLength = function(r) r:number("max") end,
    GatewareOffset = function(r) r:number("expected") end,
}

local events = {
    Fault = function(r) fault(r) end,
    RunEnded = function(r)
        for _, name in ipairs({ "run", "frames_made", "frames_dropped", "fpga_frames_lost", "fpga_frames_corrupt" }) do
            r:number(name)
        end
    end,
}

local function frame(r)
    local run = r:number("run")
    local sequence = r:number("sequence")
    r:number("device_time_us")
    r:number("sweeps")
    r:number("flags")
    -- 0x80 stands before samples of 24 bits, 0 before samples of 32 bits.
    local form = r:byte("form of the samples")
    local samples = r:block("samples", form == 0x80 and 3 or 4)
    return string.format("frame %d of run %d, %d samples", sequence, run, samples)
end

local messages = {
    Reply = function(r)
        local id = r:number("id")
        local refused = r:flag("refused") == "yes"
        local outcome = r:variant("outcome", refused and Refusal or Answer)
        local rest = (refused and refusals or answers)[outcome]
        if rest then rest(r) end
        return string.format("%s %d: %s", refused and "refusal" or "answer", id, outcome)
    end,
    Frame = frame,
    Raw = function(r)
        local first = r:number("first_clock")
        r:number("total")
        return string.format("raw burst from clock %d, %d samples", first, r:block("samples", 2))
    end,
    Depth = function(r)
        r:number("device_time_us")
        local side = r:byte("side")
        r:block("distances", 2)
        return string.format("depth map of %d x %d", side, side)
    end,
    Event = function(r)
        r:number("device_time_us")
        local kind = r:variant("event", EventKind)
        if events[kind] then events[kind](r) end
        return "event: " .. kind
    end,
    Crash = function(r)
        r:number("uptime_us")
        return "crash: " .. r:text("text")
    end,
}

-- One message; returns what the info column says.
local function dissect_message(view, tree, from_host)
    local r = reader(view, tree)
    local info
    if from_host then
        local id = r:number("id")
        local command = r:variant("command", Command)
        if commands[command] then commands[command](r) end
        info = string.format("%s (%d)", command, id)
    else
        local message = r:variant("message", DeviceMessage)
        info = messages[message] and messages[message](r) or ("message " .. message)
    end
    if r:left() > 0 then tree:add(fields.tail, r:take(r:left())) end
    return info
end

-- COBS: a code n stands before n - 1 bytes; a zero follows them, unless the code is 255 or the packet ends.
local function cobs_decode(bytes)
    local decoded, at, length = {}, 0, bytes:len()
    while at < length do
        local code = bytes:get_index(at)
        if code == 0 or at + code > length then return nil end
        for place = at + 1, at + code - 1 do decoded[#decoded + 1] = bytes:get_index(place) end
        at = at + code
        if code < 255 and at < length then decoded[#decoded + 1] = 0 end
    end
    return decoded
end

local function byte_array(numbers, from, to)
    local array = ByteArray.new()
    array:set_size(to - from + 1)
    for place = from, to do array:set_index(place - from, numbers[place]) end
    return array
end

-- CRC-32 (ISO-HDLC) of numbers[1] to numbers[last].
local table_of_crc = {}
for byte = 0, 255 do
    local crc = byte
    for _ = 1, 8 do
        local low = bit.band(crc, 1)
        crc = bit.rshift(crc, 1)
        if low == 1 then crc = bit.bxor(crc, 0xEDB88320) end
    end
    table_of_crc[byte] = crc
end

local function crc32(numbers, last)
    local crc = -1
    for place = 1, last do
        crc = bit.bxor(bit.rshift(crc, 8), table_of_crc[bit.band(bit.bxor(crc, numbers[place]), 0xFF)])
    end
    return bit.bnot(crc) % 2 ^ 32
end

-- One packet without its delimiter.
local function dissect_packet(range, tree, from_host)
    local branch = tree:add(nirspi, range)
    local function damaged(why)
        branch:add(fields.damaged, range, why)
        branch:add_expert_info(PI_CHECKSUM, PI_ERROR, "damaged packet: " .. why)
        return "damaged packet"
    end
    local decoded = cobs_decode(range:bytes())
    if not decoded then return damaged("broken COBS code") end
    local length = #decoded - 4
    if length < 1 then return damaged("shorter than its checksum") end
    local crc = 0
    for place = #decoded, length + 1, -1 do crc = crc * 256 + decoded[place] end
    local view = byte_array(decoded, 1, #decoded):tvb("message")
    branch:add_le(fields.crc, view(length, 4))
    if crc ~= crc32(decoded, length) then return damaged("wrong CRC-32") end
    local known, info = pcall(dissect_message, view(0, length):tvb(), branch, from_host)
    if not known then
        branch:add_expert_info(PI_UNDECODED, PI_WARN, "an intact message that this dissector does not know")
        info = "unknown message"
    end
    branch:append_text(", " .. info)
    return info
end

function nirspi.dissector(buffer, pinfo, tree)
    pinfo.cols.protocol = "nirspi"
    -- TCP: the camera listens on the port that this dissector is registered for. USB: the host calls itself so.
    local from_host = tostring(pinfo.src) == "host"
    if pinfo.port_type == 2 then from_host = pinfo.dst_port == pinfo.match_uint end
    local said, from = {}, 0
    local bytes = buffer:bytes()
    for at = 0, buffer:len() - 1 do
        if bytes:get_index(at) == 0 then
            if at > from then
                said[#said + 1] = dissect_packet(buffer(from, at - from), tree, from_host)
            end
            from = at + 1
        end
    end
    if from < buffer:len() then
        pinfo.desegment_offset = from
        pinfo.desegment_len = DESEGMENT_ONE_MORE_SEGMENT
    end
    if #said > 0 then
        pinfo.cols.info = #said > 4 and string.format("%s ... and %d more", said[1], #said - 1) or table.concat(said, "; ")
    end
    return buffer:len()
end

DissectorTable.get("tcp.port"):add(PORT, nirspi)
DissectorTable.get("usb.bulk"):add(0xFF, nirspi)
