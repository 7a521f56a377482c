//! Small mesh files of every readable format, written by this crate and in the style of other
//! programs.

use super::cube::block;
use super::layers::layers;
use isoform_io::{MeshWriteOptions, write_mesh};

/// Name, format and bytes of a file.
pub(crate) type MeshFixture = (String, &'static str, Vec<u8>);

/// Texts that Gmsh, Abaqus, meshio and others could have written: name, format, content.
pub(crate) const FOREIGN: [(&str, &str, &str); 8] = [
    ("meshio-zlib.vtu", "vtu", ZLIB),
    ("meshio-base64.vtu", "vtu", BASE64),
    ("appended-base64.vtu", "vtu", APPENDED),
    ("gmsh-parametric.msh", "msh", PARAMETRIC),
    ("gmsh-bare.msh", "msh2", BARE),
    ("gmsh-legacy.msh", "msh2", LEGACY),
    ("abaqus-sets.inp", "inp", SETS),
    ("abaqus-shells.inp", "inp", SHELLS),
];

const ZLIB: &str = "<?xml version=\"1.0\"?>
<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\" compressor=\"vtkZLibDataCompressor\">
<!--This file was created by meshio v5.3.5-->
<UnstructuredGrid>
<Piece NumberOfPoints=\"4\" NumberOfCells=\"4\">
<Points>
<DataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\" format=\"binary\">
AQAAAACAAABgAAAAFAAAAA==eJxjYMAHPtjjlSYo/8MeAHhtA5Y=
</DataArray>
</Points>
<Cells>
<DataArray type=\"Int64\" Name=\"connectivity\" format=\"binary\">
AQAAAACAAABwAAAAGgAAAA==eJxjYIAAJijNyIAKYHxmHOJMJMoDAAQoABQ=
</DataArray>
<DataArray type=\"Int64\" Name=\"offsets\" format=\"binary\">
AQAAAACAAAAgAAAAEwAAAA==eJxjZoAANijNBaX5oDQAAiAAIg==
</DataArray>
<DataArray type=\"Int64\" Name=\"types\" format=\"binary\">
AQAAAACAAAAgAAAAEwAAAA==eJxjZYAAVijNBaU5oTQAAiAAHg==
</DataArray>
</Cells>
<CellData>
<DataArray type=\"Int64\" Name=\"part\" format=\"binary\">
AQAAAACAAAAgAAAAEQAAAA==eJxjZ4AAZgZUAOMDAAFgAA4=
</DataArray>
</CellData>
</Piece>
</UnstructuredGrid>
</VTKFile>
";

const BASE64: &str = "<VTKFile type='UnstructuredGrid' version='0.1' byte_order='LittleEndian'>
<UnstructuredGrid>
<Piece NumberOfPoints='4' NumberOfCells='4'>
<PointData><DataArray type='Float64' Name='odd &lt;x&gt;' format='ascii'> 1 2 3 nan </DataArray></PointData>
<Points>
<DataArray type='Float64' Name='Points' NumberOfComponents='3' format='binary'>
YAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAPA/AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA8D8AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAD4Pw==
</DataArray>
</Points>
<Cells>
<DataArray type='Int64' Name='connectivity' format='binary'>
cAAAAAAAAAAAAAAAAgAAAAAAAAABAAAAAAAAAAAAAAAAAAAAAQAAAAAAAAADAAAAAAAAAAAAAAAAAAAAAQAAAAAAAAACAAAAAAAAAAMAAAAAAAAAAAAAAAAAAAABAAAAAAAAAAIAAAAAAAAAAwAAAAAAAAA=
</DataArray>
<DataArray type='Int32' Name='offsets' format='ascii'>3 6 10 14</DataArray>
<DataArray type='UInt8' Name='types' format='ascii'>5 5 10 9</DataArray>
</Cells>
<CellData><DataArray type='Float32' Name='part' format='ascii'>7 3 0 3</DataArray></CellData>
</Piece>
</UnstructuredGrid>
</VTKFile>
";

const APPENDED: &str = "<VTKFile type='UnstructuredGrid' version='0.1' byte_order='LittleEndian'><UnstructuredGrid><Piece NumberOfPoints='4' NumberOfCells='2'>
<Points><DataArray type='Float64' Name='Points' NumberOfComponents='3' format='appended' offset='0'/></Points>
<Cells><DataArray type='Int64' Name='connectivity' format='ascii'>0 1 2 3 3</DataArray>
<DataArray type='Int64' Name='offsets' format='ascii'>4 5</DataArray>
<DataArray type='Int64' Name='types' format='ascii'>10 1</DataArray></Cells>
</Piece></UnstructuredGrid><AppendedData encoding='base64'>
 _YAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAPA/AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA8D8AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAD4Pw==
</AppendedData></VTKFile>
";

const PARAMETRIC: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n2 40 \"skin of it\"\n3 7 \"body\"\n$EndPhysicalNames\n$Comments\nby hand\n$EndComments
$Entities\n1 0 2 1\n1 0 0 0 0\n3 0 0 0 1 1 0 1 40 0\n9 0 0 0 1 0 1 0 1 -3\n5 0 0 0 1 1 1 1 7 2 3 9\n$EndEntities
$Nodes\n2 4 10 40\n2 3 1 2\n40\n10\n1 0 0 0.5 0.5\n0 0 0 0 0\n3 5 0 2\n20\n30\n0 1 0\n0 0 1\n$EndNodes
$Elements\n4 5 1 5\n0 1 15 1\n1 10\n2 3 2 1\n4 10 20 40\n2 9 3 1\n2 10 40 20 30\n3 5 4 1\n3 10 40 20 30\n$EndElements\n";

const BARE: &str = "$MeshFormat\r\n2.2 0 8\r\n$EndMeshFormat\r\n$Nodes\r\n5\r\n1 0 0 0\r\n2 1 0 0\r\n3 0 1 0\r\n4 0 0 1\r\n6 9 9 9\r\n$EndNodes\r\n$Elements\r\n4\r
1 2 2 0 8 1 3 2\r\n2 2 2 0 9 1 2 4\r\n3 4 2 0 1 1 2 4 3\r\n4 5 2 0 1 1 2 3 4 1 2 3 4\r\n$EndElements\r\n";

const LEGACY: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$ParametricNodes\n4\n1 0 0 0 0 1\n2 6 0 0 1 1 0.25\n3 6 6 0 2 1 0.5 0.5\n4 0 6 0 3 1\n$EndParametricNodes
$Elements\n2\n1 2 2 1 1 1 2 3\n2 2 2 1 1 1 3 4\n$EndElements\n";

const SETS: &str = "*HEADING\nby hand, units: mm\n** Units: mm\n*Part, name=P\n*Node\n 1, 0., 0., 0.\n 2, 1., 0.\n 3, 0., 1D0, 0.\n 4, 0., 0., 1.\n 5, 1., 1., 1.
*Element, type=C3D4H, elset=Body\n 10, 1, 2, 3,\n 4\n 12, 2, 3, 4, 5\n*Element, type=C3D8\n 13, 1, 2, 3, 4, 5, 1, 2, 3\n*Elset, elset=_top, internal, generate\n 10, 12, 2
*Elset, elset=_top\n Body, 99\n*Surface, type=ELEMENT, name=Top\n_top, S1\n12, S3\n*Surface, type=NODE, name=N\n1\n*End Part\n*Step\n*End Step\n";

const SHELLS: &str = "*NODE, NSET=ALL\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n*ELEMENT,TYPE=STRI3,ELSET=A\n1,1,2,3\n*ELEMENT,TYPE=S3R,ELSET=b\n2,1,3,4\n*ELEMENT,TYPE=CPS4\n3,1,2,3,4\n";

/// Returns one file per format and variant.
pub(crate) fn mesh_fixtures() -> Vec<MeshFixture> {
    let mut all: Vec<MeshFixture> = Vec::new();
    for order in [1, 2] {
        let mesh = block(1, order);
        for format in [
            "msh",
            "msh-binary",
            "msh2",
            "vtu",
            "vtu-ascii",
            "inp",
            "stl",
            "stl-ascii",
            "obj",
            "ply",
            "ply-ascii",
            "off",
            "3mf",
        ] {
            let mut bytes = Vec::new();
            write_mesh(&mesh, &mut bytes, format, &MeshWriteOptions::default())
                .expect("memory takes all");
            all.push((format!("{format}-{order}"), format, bytes));
        }
    }
    for format in ["msh", "msh-binary", "msh2", "vtu-ascii", "inp"] {
        let mut bytes = Vec::new();
        write_mesh(&layers(), &mut bytes, format, &MeshWriteOptions::default())
            .expect("memory takes all");
        all.push((format!("{format}-layers"), format, bytes));
    }
    all.extend(
        FOREIGN.map(|(name, format, text)| (name.to_owned(), format, text.as_bytes().to_vec())),
    );
    all
}
