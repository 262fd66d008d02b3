model Mixer "A dye that is pumped into water"
  input Real F(unit="m3/s") "Flow of the dye";
  output Real c(unit="1", start=0.0, fixed=true, nominal=0.1) "Share of the dye";
  Real V(unit="m3", start=2.0, fixed=true, nominal=2.0) "Volume";
equation
  der(c) = F*(1.0 - c)/V;
  der(V) = F;
end Mixer;
