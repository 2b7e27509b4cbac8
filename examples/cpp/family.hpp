#pragma once

#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>

namespace deepmuon {

inline std::string read_file(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    std::string contents{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    if (!file) {
        throw std::runtime_error("can't read " + path);
    }
    return contents;
}

// Walks through the fields of a message of Protocol Buffers, which is what an ONNX file is, from begin to end:
// visit(number, begin, end) gets those that hold bytes. See https://protobuf.dev/programming-guides/encoding/
template <class Visit> void fields(const std::string& message, std::size_t begin, std::size_t end, Visit visit) {
    const auto varint = [&] {
        std::uint64_t number = 0;
        for (int shift = 0; begin < end && shift < 64; shift += 7) {
            const auto byte = static_cast<unsigned char>(message[begin++]);
            number |= std::uint64_t(byte & 0x7f) << shift;
            if (byte < 0x80) {
                return number;
            }
        }
        throw std::runtime_error("no ONNX file: a number is cut off");
    };
    while (begin < end) {
        const std::uint64_t tag = varint(), type = tag & 7;
        const std::uint64_t size = type == 0 ? (varint(), 0) : type == 1 ? 8 : type == 2 ? varint() : type == 5 ? 4 : end;
        if (size > end - begin) {
            throw std::runtime_error("no ONNX file: a field is cut off");
        }
        if (type != 0) {
            visit(tag >> 3, begin, begin + size);
        }
        begin += size;
    }
}

// A family with another depth in it, in metres of its medium: the four bytes of its initializer depth_m are replaced. What
// follows from them any engine calculates while it loads the model.
inline std::string at_depth(std::string contents, float depth) {
    constexpr std::uint64_t graph = 7, initializer = 5, name = 8, float_data = 4, raw_data = 9; // fields of onnx.proto
    std::size_t found = 0, times = 0;
    fields(contents, 0, contents.size(), [&](std::uint64_t field, std::size_t begin, std::size_t end) {
        if (field != graph) {
            return;
        }
        fields(contents, begin, end, [&](std::uint64_t field, std::size_t begin, std::size_t end) {
            std::size_t number = 0;
            bool is_depth = false;
            if (field != initializer) {
                return;
            }
            fields(contents, begin, end, [&](std::uint64_t field, std::size_t begin, std::size_t end) {
                is_depth = is_depth || (field == name && contents.compare(begin, end - begin, "depth_m") == 0);
                number = (field == float_data || field == raw_data) && end - begin == 4 ? begin : number;
            });
            if (is_depth && number != 0) {
                found = number;
                ++times;
            }
        });
    });
    if (times != 1) {
        throw std::runtime_error("no family: there is no depth to be set");
    }
    std::uint32_t bits;
    static_assert(sizeof bits == sizeof depth, "a float is to have four bytes");
    std::memcpy(&bits, &depth, sizeof bits);
    for (int byte = 0; byte < 4; ++byte) {
        contents[found + byte] = static_cast<char>(bits >> 8 * byte & 0xff);
    }
    return contents;
}

} // namespace deepmuon
