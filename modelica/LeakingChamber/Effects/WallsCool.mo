within LeakingChamber.Effects;
model WallsCool "walls that cool, or warm up, during the recording"
  extends Interfaces.PartialHeat;
  parameter Real slope(unit="K/s", min=-1.0, max=1.0) = 0.0 "Rate of the walls' temperature";
  parameter Real T(unit="K", min=1.0) = 293.15 "Temperature of the walls";
equation
  rate = pAir/T*slope;
  annotation (
    __Workbench(effect(
      size="slope", matters=6e-3,
      separation="a thermometer at the wall")),
    Documentation(info="<html>
<p>After it was handled, or filled with warm air, a wall comes back to the temperature of the room;
over two minutes in proportion to time. 0.006 K/s are 20 mbar.</p>
</html>"));
end WallsCool;
