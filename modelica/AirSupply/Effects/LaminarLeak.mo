within AirSupply.Effects;
model LaminarLeak "a leak in proportion to the pressure"
  extends Common.Leaks.Laminar(conductance(max=1e-8));
  annotation (
    __Workbench(effect(
      size="conductance", matters=5e-11,
      separation="the fall of the pressure from full to half with the compressor off")),
    Documentation(info="<html>
<p>Narrow gaps: seals, threads, cracks.</p>
</html>"));
end LaminarLeak;
