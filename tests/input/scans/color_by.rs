//! Colors by height and by what points carry.

use surfel::input::{self, ColorSetting, LoadedMesh, PointColoring, ReadOptions};
use surfel::progress::SilentProgress;

use super::remarks;

const TABLE: &str = "x,y,z,intensity,class,red,green,blue\n\
                     0,0,0,10,2,1,2,3\n1,0,5,20,6,1,2,3\n2,0,10,30,2,1,2,3\n3,0,7,,99,1,2,3\n";

fn colored(by: &str, range: Option<[f64; 2]>) -> Result<LoadedMesh, input::Error> {
    let by: PointColoring = by.parse().unwrap();
    let options = ReadOptions {
        color: Some(ColorSetting { by, range }),
        ..ReadOptions::default()
    };
    input::load_bytes("a.csv", TABLE.as_bytes(), &options, &SilentProgress)
}

#[test]
fn quantities_categories_and_height_color() {
    let intensity = colored("intensity", None).unwrap();
    let colors = &intensity.mesh.colors;
    let (dark, light) = (colors[0], colors[2]);
    assert!(dark[0] < 80 && dark[1] < 10 && light[0] > 240 && light[1] > 220);
    assert_eq!(colors[3], [128, 128, 128, 255]);
    let said = remarks(&intensity);
    assert!(
        said.contains("colors show intensity: dark blue 10 to yellow 30"),
        "{said}"
    );

    // The range that is asked for.
    let wide = colored("Intensity", Some([30.0, 50.0])).unwrap();
    assert_eq!(wide.mesh.colors[2], dark);
    assert_eq!(wide.mesh.colors[0], dark);

    let class = colored("class", None).unwrap();
    let colors = &class.mesh.colors;
    assert_eq!(colors[0], [170, 120, 70, 255]);
    assert_eq!((colors[0], colors[1]), (colors[2], [220, 80, 60, 255]));
    let said = remarks(&class);
    assert!(
        said.contains("2 ground #aa7846, 6 building #dc503c, 99 #"),
        "{said}"
    );

    let height = colored("height", None).unwrap();
    assert_eq!(
        (height.mesh.colors[0], height.mesh.colors[2]),
        (dark, light)
    );

    let text = colored("warmth", None).unwrap_err().to_string();
    assert_eq!(
        text,
        "a.csv: no attribute `warmth` to color by; there is height, intensity, class"
    );
}
