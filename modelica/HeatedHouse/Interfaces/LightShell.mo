within HeatedHouse.Interfaces;
model LightShell "Null version: walls store nothing"
  extends PartialShell;
equation
  actual = nominal;
end LightShell;
