within ServoPendulum.Drive;
model NominalResistance "Null version: the nominal resistance"
  extends PartialResistance;
equation
  y = u;
end NominalResistance;
