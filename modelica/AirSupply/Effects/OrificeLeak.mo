within AirSupply.Effects;
model OrificeLeak "a leak through a hole"
  extends Common.Leaks.Orifice(C(max=1e-8));
  annotation (
    __Workbench(effect(
      size="C", matters=4e-11,
      separation="the fall of the pressure from full to half with the compressor off")),
    Documentation(info="<html>
<p>A hole, or an open drain. It is choked at all pressures of the unit, so that the flow is in proportion
to the absolute pressure.</p>
</html>"));
end OrificeLeak;
