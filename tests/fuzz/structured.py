#!/usr/bin/env python3
"""Files of every format that is read, made on purpose: right in their structure, absurd in their numbers. Each goes to `kfdesign info`.

    tests/fuzz/structured.py target/release/kfdesign --seconds 7200 --keep FOLDER [--seed N] [--only hdf5,mat] [SAMPLE...]

A finding is an exit status that is not 0 or 2, or more than 5 s of processor time. Memory is limited to four times the file, 16 MiB, and the numbers
that are kept (16 bytes a row, since a column grows by doubling): who wants more is ended by the system. The file of a finding stays in FOLDER, under its seed. Samples are
intact files, which are cut, repeated and changed. Needs nothing but Python's own library; exits with 1 if there are findings.
"""
import argparse, bz2, gzip, json, os, random, resource, shutil, signal, struct, subprocess, sys, tempfile, time, zlib

R = random.Random()
STACKS = 2 * (2 << 20)  # of two threads: the system counts them as a whole, though they are hardly used
CALM = 0  # how often a number is one that makes sense, so that readers also come far



def odd(most=2**32 - 1):
    """A number that somebody forgot to look at."""
    if R.random() < CALM:
        return R.randrange(1, 40) & most
    n = R.choice([0, 1, 2, 3, 7, 8, 100, 255, 256, 4096, 65535, 65536, 1 << 20, (1 << 24) + 1, (1 << 31) - 1, 1 << 31, 2**32 - 1,
                  1 << 40, (1 << 63) - 1, 1 << 63, 2**64 - 1, R.randrange(1000), R.getrandbits(32)])
    return n & most


def count(most=5):
    """A number of things: mostly few, sometimes very many."""
    return R.randrange(1, 5) if R.random() < 0.7 else int(10 ** R.uniform(0, most))


def name(most=70000):
    words = [b'gyro_x', b'accel_y', b't', b'time', b'a', b'gyro', b'stamp (us)', b'w_z [rad/s]', b'\xff\x1b[31m', '\u2028x'.encode()]
    return R.choice(words) if R.random() < 0.8 else R.choice([b'N', b'\xff', b'gyro ']) * min(count(), most // 5)


def chaos(n):
    return R.choice([lambda: bytes(n), lambda: R.randbytes(min(n, 100000)), lambda: bytes([R.randrange(256)]) * n])()


def npy():
    def field(depth=0):
        kind = R.choice(["'<f8'", "'<f4'", "'u1'", "'i2'", "'S0'", "'S9'", "'O'", "'<M8[ns]'", "'V1000000'"])
        if depth < 40 and R.random() < 0.05:
            kind = '[' + field(depth + 1) + ']' * R.choice([1, 1, 1, 50])
        shape = R.choice(['', '', f', ({odd()},)', ', (4096,)', ', (3,)', ', (1, 2)'])
        return f"('{name(300).decode('latin1')}', {kind}{shape})"
    descr = R.choice(["'<f8'", "'u1'", "'<f4'"]) if R.random() < 0.3 else '[' + ', '.join([field() for _ in range(R.randrange(1, 4))] * min(count(), 20000)) + ']'
    shape = R.choice([f'({odd()},)', f'({odd()}, {odd()})', '(0,)', '(10,)', '(10, 3)', '(' + '1,' * count() + ')'])
    head = f"{{'descr': {descr}, 'fortran_order': {R.choice([True, False])}, 'shape': {shape}, }}\n".encode('latin1')
    return b'\x93NUMPY\2\0' + struct.pack('<I', len(head)) + head + chaos(R.choice([0, 80, 240, 10000]))


def ulog():
    def message(kind, content):
        content = content[:65535]
        return struct.pack('<HB', len(content), ord(kind)) + content
    out = [b'ULog\x01\x12\x35\x01' + struct.pack('<Q', 1000)]
    topics = [b'q%d' % i for i in range(min(count(), 20000))] + [b'sensor_gyro', b'sensor_gyro_fifo', b'vehicle_imu']
    for topic in topics if len(topics) > 20 else topics * R.randrange(1, 3):
        kinds = [b'float', b'uint8_t', b'uint64_t', b'double', R.choice(topics), b'int16_t[%d]' % odd(20000), b'char[3]', R.choice(topics) + b'[%d]' % R.randrange(40)]
        fields = [R.choice(kinds) + b' ' + R.choice([b'timestamp', b'x', b'y', b'samples', b'dt', b'scale', b'x[0]', name(5000)]) for _ in range(R.randrange(1, 6))]
        out.append(message('F', topic + b':' + b';'.join(fields) + b';'))
    if R.random() < 0.2:
        out.append(message('B', bytes(8) + bytes([1]) * 8 + struct.pack('<3Q', odd(4096), odd(4096), odd(4096))))
    announce = [message('A', struct.pack('<BH', odd(255), odd(65535)) + R.choice(topics)) for _ in range(min(count(), 50000))]
    out += announce + [message('A', b'\0\0\0' + R.choice(topics))]
    data = message('D', struct.pack('<H', R.choice([0, odd(65535)])) + chaos(R.choice([0, 1, 8, 100, 5000])))
    again = R.choice([b'', announce[0]])
    out.append((data + again) * min(count(), 200000))
    return b''.join(out)


def dataflash():
    def fmt(kind, size, text, codes, labels):
        return b'\xa3\x95\x80' + struct.pack('<BB4s16s64s', kind, size, text, codes, labels)
    out = []
    for kind in range(R.choice([1, 3, 100, 250])):
        codes = bytes(R.choice(b'bBhHiIqQgfdcCeELMnNZa') for _ in range(R.randrange(1, 17)))
        labels = b','.join(R.choice([b'TimeUS', b'I', b'GyrX', b'AccY', b'N', b'seqno', b'x', b'T', b'']) for _ in range(16))[:64]
        text = R.choice([b'IMU', b'GYR', b'ISBH', b'ISBD', b'M%03d' % kind])
        out.append(fmt(kind, odd(255), text, codes, labels))
    out.append(fmt(200, R.choice([3, 12, 40]), b'IMU', b'QBfff', b'TimeUS,I,GyrX,GyrY,GyrZ'))
    for _ in range(R.choice([1, 10, 300])):
        out.append((b'\xa3\x95' + bytes([R.choice([200, odd(255)])]) + R.randbytes(R.choice([0, 9, 37, 86]))) * R.choice([1, 1, 2000]))
    return b''.join(out)


def mat():
    def element(kind, content, size=None):
        return struct.pack('<II', kind, len(content) if size is None else size) + content + bytes(-len(content) % 8)
    def matrix(depth=0):
        kind = R.choice([1, 2, 2, 2, 3, 4, 5, 6, 6, 6, 7, 9, 12, 17])
        rows, columns = R.choice([(1, 1), (10, 3), (3, 10), (odd(), 1), (count(), count(2)), (odd(), odd())])
        head = element(6, struct.pack('<II', kind | R.choice([0, 0, 0, 0x800]), 0)) + element(5, struct.pack('<2I', rows, columns)) + element(1, name() if depth == 0 else b'')
        if kind == 2 and depth < R.choice([3, 12, 60]):
            length = R.choice([1, 1, 8, 32, odd()])
            names = chaos(R.choice([1, 8, 64, 3000, 65536, 1 << 20]))
            inner = matrix(depth + 1)
            rest = element(5, struct.pack('<I', length)) + element(1, names) + inner * min(R.choice([1, 1, 3, min(count(), 3000)]), max(1, 4000000 // len(inner)))
        elif R.random() < 0.8:
            n = min(rows * columns, 1 << R.choice([4, 10, 20]))
            rest = element(9, bytes(8 * n)) if R.random() < 0.5 else element(R.choice([1, 2, 5, 7, 99]), bytes(n), odd() if R.random() < 0.2 else None)
        else:
            rest = struct.pack('<II', R.choice([0, 1, 14]), 0) * min(count(6), 1000000)
        return element(14, head + rest, odd() if R.random() < 0.03 else None)
    out = b'MATLAB 5.0 MAT-file'.ljust(124) + b'\0\1IM'
    for _ in range(R.randrange(1, 4)):
        try:
            one = matrix()
        except RecursionError:
            continue
        if R.random() < 0.6:
            packed = zlib.compress(one * 1, R.choice([1, 9]))
            one = struct.pack('<II', 15, len(packed)) + packed
        out += one * R.choice([1, 1, 1, min(count(), max(1, 4000000 // len(one)))])
    return out


def hdf5():
    b = bytearray(48)
    def put(x):
        b.extend(x)
        return len(b) - len(x)
    def header(messages):
        body = b''.join(struct.pack('<BHB', kind, len(m), R.choice([0, 0, 0, 0, 2]) if R.random() < .02 else 0) + m for kind, m in messages)
        return b'OHDR\2\2' + struct.pack('<I', len(body)) + body + bytes(4)
    def link(text, to):
        return b'\1\2' + struct.pack('<I', len(text)) + text + struct.pack('<Q', to)
    def number():
        return R.choice([struct.pack('<BBBBI', 0x10, R.choice([0, 8]), 0, 0, s) + struct.pack('<HH', 0, 8 * s) for s in (1, 2, 4, 8)]
                        + [struct.pack('<BBBBI', 0x11, 0x20, 63, 0, 8) + struct.pack('<HHBBBBI', 0, 64, 52, 11, 0, 52, 1023)])
    def record():
        n = R.choice([1, 3, 900, 2000])
        inner = number()
        return struct.pack('<BBHI', 0x36, n & 255, n >> 8, R.choice([8, 8 * n, 65535])) + b''.join(b'f%d\0' % i + R.choice([b'\0', bytes(2)]) + inner for i in range(n))
    def attribute():
        text = R.choice([b'unit\0', b'fs\0', name(200) + b'\0'])
        kind, value = R.choice([(number(), bytes(8)), (struct.pack('<BBBBI', 0x13, 0, 0, 0, 5), b'deg/s'), (struct.pack('<BBBBI', 0x19, 1, 0, 0, 16), struct.pack('<IQI', odd(), odd(4095), 1))])
        shape = bytes([2, 0, 0, 0])
        return 0xc, struct.pack('<BBHHHB', 3, 0, len(text), len(kind), len(shape), 0) + text + kind + shape + value
    def dataset():
        kind = record() if R.random() < 0.2 else number()
        rank = R.choice([0, 1, 1, 1, 2, 2, 3, 40])
        shape = [R.choice([3, 10, 1000, 1 << 20, odd(2**64 - 1)]) for _ in range(rank)]
        chunk = [R.choice([1, 10, 4096, 1 << 20, 1 << 24]) for _ in range(rank)]
        style = R.randrange(5)
        z = zlib.compress(bytes(R.choice([80, 4096, 1 << 20, 1 << 23])), 9)
        if style == 0:
            layout = bytes([3, 0]) + struct.pack('<H', 100) + bytes(R.choice([100, 10]))
        elif style == 1:
            layout = bytes([3, 1]) + struct.pack('<QQ', R.choice([48, odd(4095), put(bytes(8000))]), odd())
        elif style == 2:
            at, n = put(z), min(count(4), 60000)
            steps = max(1, (chunk + [1])[0])
            entries = b''.join(struct.pack('<II', len(z), 0) + b''.join(struct.pack('<Q', i * steps if d == 0 else 0) for d in range(rank)) + bytes(8) + struct.pack('<Q', at + (i % 3 if R.random() < .01 else 0)) for i in range(n))
            tree = put(b'TREE\1' + bytes([R.choice([0, 0, 0, 1])]) + struct.pack('<H', n) + b'\xff' * 16 + entries + bytes(8 * (rank + 2)))
            layout = bytes([3, 2, (rank + 1) & 255]) + struct.pack('<Q', tree) + b''.join(struct.pack('<I', c) for c in chunk) + struct.pack('<I', 1)
            shape = [n * steps] + shape[1:] if rank and R.random() < .8 else shape
        elif style == 3:
            layout = bytes([4, 2, 2, (rank + 1) & 255, 4]) + b''.join(struct.pack('<I', c) for c in chunk) + struct.pack('<I', 1) + bytes([1]) + struct.pack('<QIQ', len(z), 0, put(z))
        else:
            layout = bytes([4, 2, 0, (rank + 1) & 255, 4]) + b''.join(struct.pack('<I', c) for c in chunk) + struct.pack('<I', 1) + bytes([R.choice([2, 3])]) + struct.pack('<Q', R.choice([48, odd(4095)]))
        ids = [R.choice([1, 1, 2, 3, 32000]) for _ in range(R.choice([0, 1, 1, 2, 50]))]
        pipe = bytes([2, len(ids)]) + b''.join(struct.pack('<HHHI', i, *([0] if i < 256 else [0]), 1, R.choice([1, 8, odd()])) if i < 256 else struct.pack('<HHHHI', i, 0, 0, 1, 1) for i in ids)
        dims = bytes([2, rank & 255, 0, 1]) + b''.join(struct.pack('<Q', s & (2**64 - 1)) for s in shape)
        return [(1, dims), (3, kind), (8, layout), (0xb, pipe)] + [attribute() for _ in range(R.choice([0, 1, min(count(4), 9000)]))]
    objects = [put(header(dataset())) for _ in range(R.choice([1, 2, 5, 200]))]
    for _ in range(R.choice([1, 3, 14, 40])):
        text = name(60000)
        links = [link(text[:60000] + b'%d' % i, R.choice(objects[-3:] + [48, odd(65535)] if R.random() < .1 else objects[-3:])) for i in range(min(count(4), 9000 if len(text) < 100 else 50))]
        objects.append(put(header([(6, m) for m in links])))
    b[:48] = b'\x89HDF\r\n\x1a\n' + bytes([2, 8, 8, 0]) + struct.pack('<QQQQI', 0, 2**64 - 1, len(b), objects[-1], 0)
    return bytes(b)


def varint(n):
    out = b''
    while n > 127:
        out, n = out + bytes([n & 127 | 128]), n >> 7
    return out + bytes([n])


def thrift(fields):
    """Fields as (number, kind, value) in the compact protocol."""
    out, last = b'', 0
    zigzag = lambda n: varint(n << 1 if n >= 0 else (-n << 1) - 1)
    def value(kind, x):
        if kind in (4, 5, 6):
            return zigzag(x)
        if kind == 8:
            return varint(len(x)) + x
        if kind == 9:
            of, items = x
            n = len(items) if R.random() < .995 else odd()
            return (bytes([n << 4 | of]) if n < 15 else bytes([0xf0 | of]) + varint(n)) + b''.join(value(of, i) for i in items)
        return thrift(x) if kind == 12 else x
    for number, kind, x in fields:
        out += (bytes([(number - last) << 4 | kind]) if 0 < number - last < 16 else bytes([kind]) + zigzag(number)) + value(kind, x)
        last = number
    return out + b'\0'


def parquet():
    rows = R.choice([1, 100, 5000, odd(2**31 - 1)])
    columns = [(name(3000), R.choice([0, 1, 2, 4, 5, 3, 7])) for _ in range(R.choice([1, 2, 4, min(count(4), 5000)]))]
    def node(text, kind=None, children=0):
        fields = [(1, 5, kind)] if kind is not None else []
        fields += [(2, 5, R.choice([2, 12, odd(2**31 - 1)]))] if kind == 7 else []
        return fields + [(3, 5, R.choice([0, 0, 1, 2] if R.random() < .2 else [0])), (4, 8, text)] + ([(5, 5, children)] if children else [])
    deep = R.choice([0, 0, 1, 5, 25, 20000])
    schema = [node(b'root', children=1 if deep else len(columns))]
    schema += [node(name(3000), children=1 if i + 1 < deep else len(columns)) for i in range(deep)]
    schema += [node(*column) for column in columns]
    body, chunks = bytearray(b'PAR1'), []
    for text, kind in columns[:3] + columns[:1] * max(0, len(columns) - 3):
        if len(body) > 16 << 20:
            break
        start, codec = len(body), R.choice([0, 0, 2, 2, 1, 5, 6, 7])
        dictionary = R.random() < .4
        pages = []
        for page in ['dictionary'] * dictionary + ['data'] * R.choice([1, 1, 3]):
            raw = bytes(R.choice([0, 8, 800, 40000, 1 << 20]))
            if page == 'data' and dictionary:
                raw = bytes([R.choice([0, 1, 8, 32, 255])]) + R.choice([varint(rows << 1) + bytes(4), varint(odd() | 1) + bytes(40)])
            packed = zlib.compress(raw, wbits=31) if codec == 2 else R.choice([raw[:2000], varint(odd()) + R.randbytes(30)]) if codec in (1, 7) else raw if codec == 0 else b'\x28\xb5\x2f\xfd' + R.choice([b'\0' + bytes([odd(255)]), b'\xe0' + struct.pack('<Q', odd(2**64 - 1))]) + b'\x03\0\x10' + R.randbytes(9)
            values = R.choice([rows, odd(2**31 - 1), 1])
            head = [(1, 5, 2 if page == 'dictionary' else 0), (2, 5, len(raw) if R.random() < .9 else odd(2**31 - 1)), (3, 5, len(packed) if R.random() < .97 else odd(2**31 - 1))]
            head += [(7, 12, [(1, 5, values), (2, 5, 0)])] if page == 'dictionary' else [(5, 12, [(1, 5, values), (2, 5, 8 if dictionary else R.choice([0, 0, 3, 5, 9])), (3, 5, 3), (4, 5, 3)])]
            body += thrift(head) + packed
            pages.append(len(raw))
        whole = len(body) - start if R.random() < .95 else odd(2**31 - 1)
        meta = [(1, 5, kind), (2, 9, (5, [0, 8])), (3, 9, (8, [text])), (4, 5, codec), (5, 6, rows), (6, 6, sum(pages) + 1000 if R.random() < .9 else odd(2**62)), (7, 6, whole), (9, 6, start)]
        meta += [(11, 6, start)] if dictionary else []
        chunks.append([(2, 6, start), (3, 12, meta)])
    group = [(1, 9, (12, chunks)), (2, 6, 1000), (3, 6, rows)]
    groups = [group] * (R.choice([1, 1, 2, min(count(4), 2000)]) if len(chunks) < 50 else 1)
    total = R.choice([rows * len(groups), odd(2**62)])
    foot = thrift([(1, 5, 1), (2, 9, (12, schema)), (3, 6, total), (4, 9, (12, groups))])
    return bytes(body) + foot + struct.pack('<I', len(foot)) + b'PAR1'


def zstd(n):
    """n zeros in blocks of 128 KiB that repeat a byte."""
    blocks, out = n >> 17, b'\x28\xb5\x2f\xfd\0' + bytes([R.choice([(20 - 10) << 3, 17 << 3, 0, 255])])
    for i in range(blocks + 1):
        size = 1 << 17 if i < blocks else n & 0x1ffff
        out += struct.pack('<I', size << 3 | 2 | (i == blocks))[:3] + b'\0'
    return out


def imu():
    return struct.pack('<IIII', 0, 0, 0, 0) + bytes(37 * 8)


def packed(kind, data):
    n = R.choice([len(data), len(data), odd(2**33), 1 << 22])
    if kind == b'bz2':
        data = data[:1 << 20]  # more takes Python a minute
        return bz2.compress(data), len(data) if R.random() < .7 else n
    if kind == b'zstd':
        size = R.choice([1 << 16, 1 << 22, 1 << 26, 1 << 31])
        return zstd(size), R.choice([size, n])
    return (data, n) if kind == b'none' or not kind else (b'\x04\x22\x4d\x18' + R.randbytes(40), n)


def mcap():
    text = lambda x: struct.pack('<I', len(x)) + x
    record = lambda code, x: struct.pack('<BQ', code, len(x) if R.random() < .999 else odd(2**64 - 1)) + x
    channel = lambda i: record(4, struct.pack('<HH', i & 65535, 1) + text(b'/imu%d' % i + name(3000) * (R.random() < .05)) + text(R.choice([b'cdr', b'ros1', b'json'])) + bytes(4))
    message = lambda i: record(5, struct.pack('<HIQQ', i & 65535, 0, odd(2**64 - 1), 1) + R.choice([b'', imu(), imu()[:40]]))
    schema = record(3, struct.pack('<H', 1) + text(R.choice([b'sensor_msgs/msg/Imu', name()])) + text(b'') + text(b''))
    channels = b''.join(channel(i) for i in range(min(count(), 30000)))
    data = schema + channels + message(0) * min(count(), 100000) + b''.join(message(R.randrange(300)) for _ in range(300))
    if R.random() < .7:
        kind = R.choice([b'zstd', b'lz4', b'', b'none', b'xz'])
        z, n = packed(kind, data)
        data = record(6, struct.pack('<QQQI', 0, 0, n & (2**64 - 1), 0) + text(kind) + struct.pack('<Q', len(z)) + z) * R.choice([1, 1, 3, 200 if len(z) < 20000 else 1])
    return b'\x89MCAP0\r\n' + data + record(2, bytes(20))


def rosbag():
    head = lambda fields: b''.join(struct.pack('<I', len(f)) + f for f in fields)
    def record(fields, data):
        h = head(fields)
        return struct.pack('<I', len(h)) + h + struct.pack('<I', len(data) if R.random() < .999 else odd()) + data
    def connection(i):
        return record([b'op=\x07', b'conn=' + struct.pack('<I', i), b'topic=/imu%d' % i + name(3000) * (R.random() < .05)], head([b'type=' + R.choice([b'sensor_msgs/Imu', name(3000)])]))
    message = record([b'op=\x02', b'conn=' + struct.pack('<I', 0), b'time=' + R.randbytes(8)] + [name(20)] * R.choice([0, 0, 500]), imu())
    data = b''.join(connection(i) for i in range(min(count(), 30000))) + message * min(count(), 30000)
    if R.random() < .7:
        kind = R.choice([b'bz2', b'lz4', b'none', b'gzip'])
        z, n = packed(kind, data if R.random() < .7 else bytes(1 << R.choice([20, 24, 26])))
        data = record([b'op=\x05', b'compression=' + kind, b'size=' + struct.pack('<I', n & 0xffffffff)], z) * R.choice([1, 1, 100 if len(z) < 20000 else 1])
    return b'#ROSBAG V2.0\n' + data


def db3():
    size = R.choice([512, 4096, 65536])
    def big(n):
        out = bytes([n & 127])
        while n > 127:
            n >>= 7
            out = bytes([n & 127 | 128]) + out
        return out
    def row(values):
        codes = b''.join(b'\4' if isinstance(v, int) else big(13 + 2 * len(v)) for v in values)
        return bytes([len(codes) + 1]) + codes + b''.join(struct.pack('>I', v) if isinstance(v, int) else v for v in values)
    def cell(i, r, claim=None):
        return big(len(r) if claim is None else claim) + big(i) + r
    def leaf(cells, start=0):
        page, at, places = bytearray(size), size, []
        for c in cells:
            if at - len(c) < start + 12 + 2 * len(cells):
                break
            at -= len(c)
            page[at:at + len(c)] = c
            places.append(at)
        page[start:start + 8] = struct.pack('>BHHHB', 13, 0, len(places) if R.random() < .9 else odd(65535), at & 65535, 0)
        for i, p in enumerate(places):
            page[start + 8 + 2 * i:start + 10 + 2 * i] = struct.pack('>H', p)
        return page
    def interior(children, most):
        page = bytearray(size)
        page[:12] = struct.pack('>BHHHBI', 5, 0, len(children), 0, 0, R.choice(children))
        at = size
        for i, c in enumerate(children):
            at -= 5
            if at < 14 + 2 * len(children):
                break
            page[at:at + 5] = struct.pack('>IB', c, 1)
            page[12 + 2 * i:14 + 2 * i] = struct.pack('>H', at)
        return page
    first = leaf([cell(i + 1, row([b'table', t, t, i + 2, b'x'])) for i, t in enumerate([b'topics', b'messages'])], 100)
    first[:21] = b'SQLite format 3\0' + struct.pack('>H', size & 65535 if size < 65536 else 1) + b'\0\0\0'
    topics = leaf([cell(i + 1, row([i, b'/imu%d' % i, b'sensor_msgs/msg/Imu', b'cdr', b''])) for i in range(R.choice([1, 3, 50]))])
    pages = R.choice([4, 20, 500])
    messages = [interior([R.randrange(2, pages + 2) for _ in range(R.choice([1, 5, size // 9]))], pages)]
    message = row([1, 1, 5, imu()[:60]])
    for _ in range(pages):
        messages.append(R.choice([lambda: leaf([cell(1, message)] * 20), lambda: leaf([cell(1, message[:60] + struct.pack('>I', R.randrange(pages)), odd(2**40))]),
                                  lambda: interior([R.randrange(2, pages + 2) for _ in range(size // 9)], pages), lambda: bytearray(struct.pack('>I', R.randrange(pages + 4)) + b'\x08' * (size - 4))])())
    return bytes(first + topics + b''.join(map(bytes, messages)))


def text():
    cell = lambda: R.choice([b'1', b'0.5', b'', b'nan', b'x', b'1e308', b'"a', b'-7', b'\x1b[31m', b'1/131'])
    separator = R.choice([b',', b';', b'\t', b' '])
    columns = min(count(), 100000)
    calm = R.random() < .5
    line = separator.join(b'0.5' if calm else cell() for _ in range(columns)) + b'\n'
    head = separator.join(name(100000) for _ in range(columns if calm else R.randrange(1, 6))) + b'\n'
    data = R.choice([b'', head, b'Fs,100\n', b'# ' + head]) + line * min(count(6), max(1, 20000000 // len(line)))
    return gzip.compress(data * R.choice([1, 1, 10]), R.choice([1, 9])) if R.random() < .4 else data


FORMATS = [npy, ulog, dataflash, mat, hdf5, parquet, mcap, rosbag, db3, text]


def damaged(data):
    """An intact file with pieces cut out, repeated and moved, and numbers changed."""
    data = bytearray(data)
    for _ in range(R.choice([1, 1, 2, 5, 20])):
        if not data:
            break
        a = R.randrange(len(data)) if R.random() < .6 else min(R.randrange(4096), len(data) - 1) if R.random() < .5 else max(0, len(data) - 1 - R.randrange(4096))
        n = R.choice([1, 2, 4, 8, 100, 5000])
        move = R.randrange(5)
        if move == 0:
            width = R.choice([1, 2, 4, 8])
            data[a:a + width] = odd(2**(8 * width) - 1).to_bytes(width, R.choice(['little', 'big']))
        elif move == 1:
            data[a:a] = data[a:a + n] * R.choice([1, 2, min(count(4), 1000)])
        elif move == 2:
            del data[a:a + n]
        elif move == 3:
            b = R.randrange(len(data))
            data[a:a + n] = data[b:b + n]
        else:
            data[a] ^= 1 << R.randrange(8)
    return bytes(data[:64 << 20])


def run(exe, path, out, data, command=('info', '--json')):
    """Status and seconds with so many bytes of data for the process (what it has from the system, without its code)."""
    def limits():
        resource.setrlimit(resource.RLIMIT_CPU, (20, 20))
        resource.setrlimit(resource.RLIMIT_DATA, (data, data))
    with open(out, 'wb') as stdout, open(out + '.err', 'wb') as stderr:
        child = subprocess.Popen([exe, *command, path], stdout=stdout, stderr=stderr, preexec_fn=limits, env=dict(os.environ, RAYON_NUM_THREADS='2', MALLOC_ARENA_MAX='2'))
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
    return child.returncode, usage.ru_utime + usage.ru_stime


def rows(out):
    with open(out, errors='replace') as found:
        return max((topic['rows'] or 0 for topic in json.load(found)['topics']), default=0)


def one(seed, formats, samples):
    """The file of a seed, and what it is."""
    global CALM
    R.seed(seed)
    CALM = R.choice([0, .9, .99])
    if samples and R.random() < .3:
        return 'sample', damaged(R.choice(samples))
    make = R.choice(formats)
    data = make()
    return make.__name__, damaged(data) if R.random() < .2 else data


def judged(exe, path, out, size):
    """Exit status, seconds and what was said of a file, within what such a file may take."""
    allowed = 4 * size + (16 << 20) + STACKS
    status, seconds = run(exe, path, out, allowed)
    if status not in (0, 2) and run(exe, path, out, 8 << 30)[0] == 0:
        # the numbers that are kept come on top
        status, seconds = run(exe, path, out, allowed + 16 * min(rows(out), 1 << 28))
    return status, seconds, open(out + '.err', errors='replace').read()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('exe')
    parser.add_argument('samples', nargs='*')
    parser.add_argument('--seconds', type=float, default=60)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--keep', default='.')
    parser.add_argument('--only', default='')
    args = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: signal.raise_signal(signal.SIGINT))
    formats = [f for f in FORMATS if not args.only or f.__name__ in args.only.split(',')]
    samples = [open(path, 'rb').read() for path in args.samples if os.path.getsize(path) < 4 << 20]
    os.makedirs(args.keep, exist_ok=True)
    folder = tempfile.mkdtemp(dir='/dev/shm' if os.path.isdir('/dev/shm') else None)
    path, out = os.path.join(folder, 'file'), os.path.join(folder, 'out')
    began, seed, findings, read, worst = time.time(), args.seed, 0, 0, {}
    try:
        while time.time() - began < args.seconds:
            kind, data = one(seed, formats, samples)
            open(path, 'wb').write(data)
            status, seconds, said = judged(args.exe, path, out, len(data))
            read += status == 0
            why = [f'exit {status}'] * (status not in (0, 2)) + [f'{seconds:.1f} s'] * (seconds > 5)
            why += ['more than a line'] * (status == 2 and said.count('\n') != 1)
            if status == 0 and len(data) < 1 << 20:
                # the values themselves are read here; the work on them has limits of its own
                status, _ = run(args.exe, path, out, 4 << 30, ('allan', '--rate', '100', '--json'))
                why += [f'allan: exit {status}'] * (status not in (0, 1, 2))
            top = worst.setdefault(kind, [0, 0])
            worst[kind] = [top[0] + 1, max(top[1], seconds)]
            if why:
                findings += 1
                kept = os.path.join(args.keep, f'{kind}-{seed}')
                open(kept, 'wb').write(data)
                print(f'{kept}: {len(data)} bytes: {", ".join(why)}: {said[:200]!r}', flush=True)
            seed += 1
    except KeyboardInterrupt:
        pass
    shutil.rmtree(folder)
    print(f'{seed - args.seed} files from seed {args.seed}, {read} of them read, in {time.time() - began:.0f} s: {findings} findings')
    for kind, (files, seconds) in sorted(worst.items()):
        print(f'{kind:10} {files:7} files, at most {seconds:.2f} s')
    return 1 if findings else 0


if __name__ == '__main__':
    sys.exit(main())
