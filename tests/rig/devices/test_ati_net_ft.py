"""ATI Net F/T against records made by hand from its manual, and what becomes of lost and reordered datagrams."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.devices import ati_net_ft, create_device
from rig.devices.conversation import Inquire
from rig.exceptions import RigError

# sequence 5, F/T sequence 35, status 0, Fx 1500000, Fy -2250000, Fz 9806650, Tx 125000, Ty -62500, Tz 31250 counts
RECORD = bytes.fromhex("00000005 00000023 00000000 0016e360 ffddaaf0 0095a33a 0001e848 ffff0bdc 00007a12")
# as a Gamma's page shows it (firmware 2.2.59), cut
PAGE = (
    "HTTP/1.0 200 OK\r\n\r\n<netft><runstat>0x00000000</runstat><runrate>7000</runrate><cfgcalsn>FT27462</cfgcalsn>"
    "<scfgfu>{force}</scfgfu><scfgtu>{torque}</scfgtu><cfgtfx>0;0;{lift};0;0;0</cfgtfx><scfgtdu>mm</scfgtdu>"
    "<cfgcpf>{cpf}</cfgcpf><cfgcpt>1000</cfgcpt><comrdtrate>1000</comrdtrate><mfgdigver>2.2.59</mfgdigver></netft>"
)
GIVEN = {"force": "N", "torque": "Nm", "lift": "0", "cpf": "1000000"}


def parser():
    return ati_net_ft.AtiParser(1e-6, 1e-6, tick=1e9 / 7000)


def converse(device, page):
    """The conversation with a sensor that sends records at once and shows this page."""
    conversation, answer = device.start(), None
    sent = []
    try:
        while True:
            request = conversation.send(answer)
            if isinstance(request, Inquire):
                assert request.data.startswith(b"GET /netftapi2.xml HTTP/1.0")
                answer = page.encode(), 0.0
            elif hasattr(request, "data"):
                sent.append(request.data)
                answer = None
            else:
                answer = RECORD, 0.0
    except StopIteration as stop:
        return stop.value, sent


def test_a_record_made_by_hand():
    (sample,) = parser().feed(RECORD)
    assert sample.values == pytest.approx((1.5, -2.25, 9.80665, 0.125, -0.0625, 0.03125), rel=1e-15)
    assert (sample.time, sample.number, sample.flagged) == (5_000_000, 5, False)
    counts = (1_500_000, -2_250_000, 9_806_650, 125_000, -62_500, 31_250)
    assert ati_net_ft.encode(5, 35, counts) == RECORD
    assert parser().feed(ati_net_ft.encode(5, 35, counts, status=1 << 31))[0].flagged


def test_requests_are_those_of_the_manual():
    assert ati_net_ft.request(ati_net_ft.STREAM) == bytes.fromhex("1234 0002 00000000")
    assert ati_net_ft.request(ati_net_ft.STOP) == bytes.fromhex("1234 0000 00000000")
    assert ati_net_ft.request(ati_net_ft.STREAM, 1) == bytes.fromhex("1234 0002 00000001")


def test_it_asks_for_one_sample_then_its_page_then_the_stream():
    device = create_device("ati-net-ft")
    identity, sent = converse(device, PAGE.format(**GIVEN))
    assert sent == [ati_net_ft.request(2, 1), ati_net_ft.request(2)]
    assert (identity.serial, identity.firmware, identity.warnings) == ("FT27462", "2.2.59", ())
    assert identity.settings["internal_rate_hz"] == "7000"
    (sample,) = device.parser().feed(RECORD)
    assert sample.values[:4] == pytest.approx((1.5, -2.25, 9.80665, 125.0), rel=1e-15)


@pytest.mark.parametrize(
    ("force", "torque", "newtons", "metres"),
    [
        ("lbf", "lbf-in", 4.4482216152605, 0.1129848290276),
        ("kN", "N-mm", 1000.0, 0.001),
        ("kgf", "kgf-cm", 9.80665, 0.0980665),
    ],
)
def test_units_of_its_page_become_si(force, torque, newtons, metres):
    device = create_device("ati-net-ft")
    converse(device, PAGE.format(**GIVEN | {"force": force, "torque": torque}))
    (sample,) = device.parser().feed(RECORD)
    assert sample.values[0] == pytest.approx(1.5 * newtons, rel=1e-12)
    assert sample.values[3] == pytest.approx(125.0 * metres, rel=1e-12)


@pytest.mark.parametrize(
    ("options", "page", "words"),
    [
        ({}, "", "cannot be read: set the options `counts_per_force`"),
        ({"counts_per_force": 2e6}, PAGE.format(**GIVEN), "'counts_per_force' is 2e\\+06, the sensor says 1e\\+06"),
        ({}, PAGE.format(**GIVEN | {"cpf": "0"}), "no number above 0"),
        ({}, PAGE.format(**GIVEN | {"force": "stone"}), "unit 'stone': choose N and Nm"),
    ],
)
def test_a_scale_that_is_not_known_for_certain_is_refused(options, page, words):
    with pytest.raises(RigError, match=words):
        converse(create_device("ati-net-ft", **options), page)


def test_what_its_page_changes_is_a_warning():
    device = create_device("ati-net-ft", rate=500.0)
    identity, _ = converse(device, PAGE.format(**GIVEN | {"lift": "132.710"}))
    assert "it sends at 1000 Hz, not 500 Hz" in identity.warnings[0]
    assert "tool transform 0;0;132.710;0;0;0 (mm)" in identity.warnings[1]


def send(sequences):
    """Datagrams with these sequence numbers through a parser; returns what it gave, and its counts."""
    receiver, zeros = parser(), (0,) * 6
    samples = [s for n in sequences for s in receiver.feed(ati_net_ft.encode(n, 7 * n, zeros))]
    samples += receiver.finish()
    counts = receiver.counts
    assert counts.samples == len(samples)
    assert counts.bytes == 36 * len(sequences) == counts.framed + counts.skipped
    return [s.number for s in samples], counts


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_lost_and_reordered_datagrams_are_counted_exactly_and_samples_come_in_order(data):
    """Random losses between the first and the last, and datagrams that are late by up to ten places."""
    count = data.draw(st.integers(20, 120))
    lost = data.draw(st.sets(st.integers(2, count - 1), max_size=15))
    late = data.draw(st.dictionaries(st.integers(2, count - 1), st.integers(1, 10), max_size=10))
    start = data.draw(st.sampled_from([0, 2**32 - 50]))
    sent = [n for n in range(1, count + 1) if n not in lost]
    order = sorted(sent, key=lambda n: (n + late.get(n, 0) + 0.5 * (n in late), n))
    if order[0] != 1:
        return
    numbers, counts = send([(start + n) % 2**32 for n in order])
    assert [n - numbers[0] + 1 for n in numbers] == sent
    assert counts.missing == len(lost - set(range(max(sent) + 1, count + 1)))
    assert counts.reordered == sum(n < max(order[:i]) for i, n in enumerate(order) if i)
    assert counts.repeated == 0


def test_a_datagram_too_late_for_its_place_stays_missing():
    numbers, counts = send([1, 2, *range(4, 30), 3, 30])
    assert numbers == [1, 2, *range(4, 31)]
    assert (counts.missing, counts.reordered, counts.repeated) == (1, 1, 0)


def test_a_datagram_that_comes_twice_is_one_sample():
    numbers, counts = send([1, 2, 2, 4, 4, 3, 5])
    assert numbers == [1, 2, 3, 4, 5]
    assert (counts.missing, counts.reordered, counts.repeated) == (0, 1, 2)


def test_a_datagram_from_before_the_beginning_counts_for_nothing():
    """Number 3 was overtaken by 4, with which a recording begins."""
    receiver = parser()
    samples = []
    for n in (1, 2, 4, 3, 5):
        if n == 4:
            receiver.begin()
        samples += receiver.feed(ati_net_ft.encode(n, 7 * n, (0,) * 6))
    counts = receiver.counts
    assert [sample.number for sample in samples] == [1, 2, 4, 5]
    assert (counts.samples, counts.missing, counts.reordered, counts.repeated) == (2, 0, 0, 0)


def test_a_stream_that_was_started_anew_is_followed():
    numbers, counts = send([*range(1000, 1100), *range(1, 60)])
    assert numbers[:100] == list(range(1000, 1100))
    assert len(numbers) == 100 + 59 - (ati_net_ft.RESTART - 1)
    assert np.all(np.diff(numbers[100:]) == 1)
    assert (counts.resynchronisations, counts.missing, counts.repeated) == (1, ati_net_ft.RESTART - 1, 0)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.binary(max_size=80), max_size=20))
def test_garbage_never_raises(datagrams):
    receiver = parser()
    for datagram in datagrams:
        receiver.feed(datagram)
    receiver.finish()
    assert receiver.counts.bytes == receiver.counts.framed + receiver.counts.skipped
