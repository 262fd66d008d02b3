package Still
  model Level "A level that stays unless it is filled"
    input Real filling(unit="m/s");
    output Real coarse(unit="m", start=0.0, fixed=true, nominal=1.0);
    output Real fine(unit="m") = coarse "Of a sensor that is there at times";
  equation
    der(coarse) = filling;
  end Level;
end Still;
