package Vessel "A vessel that a pump fills"
  model Observer "Its volume"
    parameter Real leak(unit="m3/s") = 0.0 "What is lost";
    input Real q(unit="m3/s") "Flow of the pump";
    input Real dl(unit="m3/s") "Correction of leak";
    output Real V(unit="m3", start=0.0, fixed=true, nominal=0.01) "Volume";
    output Real through(unit="m3/s") = q "Flow that a meter sees, too";
  equation
    der(V) = q - (leak + dl);
  end Observer;
end Vessel;
