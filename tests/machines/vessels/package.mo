package Water
  model Vessels "Vessels that fill from one header, and leak"
    parameter Real leak[5](each unit="m3/s") = fill(1e-4, 5);
    parameter Real offset(unit="V") = 0.0;
    input Real pump(unit="m3/s");
    $inputs
    input Real doffset(unit="V") "Correction of offset";
    $outputs
    output Real header(unit="m", start=1.0, fixed=true, nominal=1.0);
    output Real level(unit="V") = 3.0*header + offset + doffset;
    output Real spilt(unit="m3/s") = 5e-4 - $leaks;
  equation
    $equations
    0.1*der(header) = pump - $flows;
  end Vessels;
end Water;
