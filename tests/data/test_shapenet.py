"""ShapeNet's three layouts."""

from __future__ import annotations

import numpy as np
import pytest

from mesh_files import REAL, needs_real, pointer, points_to, put, refused, source_of


class TestShapeNetCore:
    def tree(self, root, layout, n=3, synset="03797390"):
        for i in range(n):
            folder = root / synset / f"id{i}"
            file = folder / ("model.obj" if layout == "v1" else "models/model_normalized.obj")
            put(file, pointer((1, 0, 0) if layout == "v1" else (0, 0, -1)))
        return root

    @pytest.mark.parametrize("layout", ["v1", "v2"])
    @pytest.mark.parametrize("told", [True, False])
    def test_its_front_goes_to_plus_x_and_a_mugs_to_270_degrees(self, tmp_path, layout, told):
        self.tree(tmp_path, layout)
        self.tree(tmp_path, layout, synset="02958343")
        chosen = layout if told else "auto"
        source = source_of("shapenet", root=str(tmp_path), layout=chosen)
        assert source.object_ids("mug") == ["id0", "id1", "id2"]
        assert points_to(source.load("car", "id1")) == "+x"
        assert points_to(source.load("mug", "id0")) == "-y"

    def test_axes_of_the_configuration_come_first(self, tmp_path):
        self.tree(tmp_path, "v2")
        source = source_of("shapenet", root=str(tmp_path), up="+y", front="+z", turn_deg={})
        assert points_to(source.load("mug", "id0")) == "-x"

    def test_a_model_without_a_file_is_refused_unless_it_is_excluded(self, tmp_path):
        self.tree(tmp_path, "v2")
        (tmp_path / "03797390" / "hollow").mkdir()
        source = source_of("shapenet", root=str(tmp_path))
        refused(lambda: source.object_ids("mug"), tmp_path / "03797390" / "hollow", "exclude")
        source = source_of("shapenet", root=str(tmp_path), exclude=["hollow"])
        assert source.object_ids("mug") == ["id0", "id1", "id2"]

    def test_there_are_no_toilets(self, tmp_path):
        self.tree(tmp_path, "v2")
        source = source_of("shapenet", root=str(tmp_path))
        refused(lambda: source.object_ids("toilet"), "ShapeNetCore has no toilet", "layout=sem")

    def test_a_missing_synset_is_named(self, tmp_path):
        self.tree(tmp_path, "v2")
        source = source_of("shapenet", root=str(tmp_path))
        refused(lambda: source.object_ids("chair"), tmp_path / "03001627", "dataset.categories")


class TestShapeNetSem:
    METADATA = (
        "fullId,category,wnsynset,wnlemmas,up,front,unit\n"
        'wss.aa,"Mug,DrinkingUtensil",n03797390,mug,,,0.01\n'
        r'wss.bb,Toilet,n04446521,"toilet,can","0.0\,1.0\,0.0","0.0\,0.0\,1.0",0.02'
        "\n"
        "wss.cc,Toilet,n04446521,toilet,,,0.02\n"
        "wss.dd,Cup,03797390,mug,,,\n"
    )

    @pytest.fixture
    def root(self, tmp_path):
        (tmp_path / "metadata.csv").write_text(self.METADATA)
        for name, towards in (("aa", (0, -1, 0)), ("bb", (0, 0, 1)), ("dd", (0, -1, 0))):
            put(tmp_path / "models" / f"{name}.obj", pointer(towards))
        return tmp_path

    def test_categories_are_found_by_name_and_by_synset(self, root):
        source = source_of("shapenet", root=str(root), exclude=["cc"])
        assert source.object_ids("mug") == ["aa", "dd"]
        assert source.object_ids("toilet") == ["bb"]

    def test_each_model_has_its_own_axes_or_the_default(self, root):
        source = source_of("shapenet", root=str(root))
        assert points_to(source.load("toilet", "bb")) == "+x"
        assert points_to(source.load("mug", "aa")) == "-y"

    def test_the_models_may_lie_where_the_archive_puts_them(self, root):
        (root / "models-OBJ").mkdir()
        (root / "models").rename(root / "models-OBJ" / "models")
        assert source_of("shapenet", root=str(root)).object_ids("mug") == ["aa", "dd"]

    def test_what_is_missing_is_named(self, root):
        source = source_of("shapenet", root=str(root))
        refused(lambda: source.object_ids("toilett"), "metadata.csv", "did you mean 'toilet'")
        refused(lambda: source.object_ids("zeppelin"), "no category zeppelin", "column category")
        (root / "metadata.csv").write_text("id,label\n1,mug\n")
        source = source_of("shapenet", root=str(root))
        refused(lambda: source.object_ids("mug"), "metadata.csv", "no column category")
        (root / "metadata.csv").unlink()
        source = source_of("shapenet", root=str(root), layout="sem")
        refused(lambda: source.object_ids("mug"), root / "metadata.csv", "does not exist")

    @pytest.mark.parametrize(
        ("content", "named"),
        [
            (b"fullId,category\n,mug\n", "row 1 has no fullId"),
            (b'fullId,category\nwss.aa,"mug' + b"x" * 200_000, "cannot be read"),
            (b"fullId,category\nwss./etc/passwd,mug\n", "'/etc/passwd' has '/' in it"),
        ],
    )
    def test_a_damaged_or_hostile_table_is_named(self, root, content, named):
        (root / "metadata.csv").write_bytes(content)
        source = source_of("shapenet", root=str(root))
        refused(lambda: source.object_ids("mug"), named)


@needs_real
def test_real_mugs_have_their_handles_at_270_degrees():
    source = source_of(
        "shapenet", root=str(REAL / "shapenet"), exclude_file=str(REAL / "mugs_to_leave_out.txt")
    )
    ids = source.object_ids("mug")
    assert len(ids) == 129
    for object_id in ids[::4]:
        vertices = np.asarray(source.load("mug", object_id).vertices)
        # The handle makes a mug longer along y than along x, and narrower at its end.
        assert np.ptp(vertices[:, 1]) > np.ptp(vertices[:, 0])
        ends = (
            [vertices[vertices[:, 1] < -0.9 * half], vertices[vertices[:, 1] > 0.9 * half]]
            if (half := np.ptp(vertices[:, 1]) / 2)
            else []
        )
        assert np.ptp(ends[0][:, 0]) < np.ptp(ends[1][:, 0])
